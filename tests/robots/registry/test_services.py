"""Every change of the registry is recorded in the same transaction; fences only grow."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any
from unittest import mock
from uuid import uuid4

import pytest
from django.core.exceptions import ValidationError
from django.db import connections

from fleet.accounts.models import User
from fleet.audit.errors import AuditUnavailable
from fleet.audit.models import Record
from robots.link import stop_courier as courier
from robots.registry import services
from robots.registry.models import BridgeStatus, Robot, RobotProfile
from robots.shared.link.pending_stops import WaitingStop, name_of


def last_record() -> Record:
    return Record.objects.latest("id")


@pytest.mark.django_db
def test_a_robot_deleted_by_a_program_is_recorded(robot: Robot) -> None:
    gone = robot.id
    robot.delete()
    record = last_record()
    assert (record.kind, record.robot_id, record.robot_name) == ("robot.delete", gone, "TIAGo 1")
    assert record.parameters["slug"] == "tiago-1"
    assert record.actor_id is not None and record.actor_id.startswith("system:")


@pytest.mark.django_db
def test_a_stop_waits_while_its_robot_is_registered(
    robot: Robot, tmp_path: Path, settings: Any, django_capture_on_commit_callbacks: Any
) -> None:
    settings.FLEET_RUN_DIR = tmp_path
    stops = courier.pending_stops()
    for robot_id in (robot.id, uuid4()):
        stops.keep(WaitingStop(name_of(robot_id), uuid4(), robot_id, "Ann"))
    with django_capture_on_commit_callbacks(execute=True):
        gone = robot.id
        robot.delete()
        assert len(stops.all()) == 2
    assert [stop.robot == gone for stop in stops.all()] == [False]


@pytest.mark.django_db
def test_a_new_robot_is_recorded_as_entered(tiago: RobotProfile, staff: User) -> None:
    robot = Robot(slug="new", name="New", profile=tiago, master_uri="http://10.0.0.1:11311")
    services.robot_save(robot=robot, actor=staff)
    record = last_record()
    assert (record.kind, record.robot_id, record.robot_name) == ("robot.create", robot.id, "New")
    assert (record.actor_id, record.parameters["master_uri"]) == (str(staff.pk), "http://10.0.0.1:11311")


@pytest.mark.django_db
def test_a_change_is_recorded_by_field_with_from_and_to(robot: Robot, staff: User) -> None:
    robot.enabled, robot.host_aliases = False, {"tiago-42c": "10.68.0.1"}
    services.robot_save(robot=robot, actor=staff)
    record = last_record()
    assert record.kind == "robot.change"
    assert record.parameters["changes"] == [
        {"field": "enabled", "from": True, "to": False},
        {"field": "host_aliases", "from": {}, "to": {"tiago-42c": "10.68.0.1"}},
    ]


@pytest.mark.django_db
def test_saving_without_a_change_records_nothing(robot: Robot, staff: User) -> None:
    services.robot_save(robot=robot, actor=staff)
    assert not Record.objects.filter(kind="robot.change").exists()


@pytest.mark.django_db
def test_invalid_values_are_neither_saved_nor_recorded(robot: Robot, staff: User) -> None:
    robot.master_uri = "nowhere"
    with pytest.raises(ValidationError):
        services.robot_save(robot=robot, actor=staff)
    robot.refresh_from_db()
    assert robot.master_uri == "http://127.0.0.1:9"
    assert not Record.objects.filter(kind="robot.change").exists()


@pytest.mark.django_db
def test_a_change_that_cannot_be_recorded_is_not_made(robot: Robot, staff: User) -> None:
    robot.name = "Other"
    refusal = AuditUnavailable("audit_disk_full", "full")
    with (
        mock.patch("robots.registry.services.record", autospec=True, side_effect=refusal),
        pytest.raises(AuditUnavailable),
    ):
        services.robot_save(robot=robot, actor=staff)
    robot.refresh_from_db()
    assert robot.name == "TIAGo 1"


@pytest.mark.django_db
def test_an_old_form_does_not_restore_an_old_fence(robot: Robot, staff: User) -> None:
    services.fence_next(Robot.objects.get(pk=robot.pk), 41)
    robot.name = "Renamed meanwhile"
    services.robot_save(robot=robot, actor=staff)
    robot.refresh_from_db()
    assert (robot.name, robot.fence) == ("Renamed meanwhile", 42)


@pytest.mark.django_db
def test_fences_exceed_all_given_and_all_seen(robot: Robot) -> None:
    assert services.fence_next(robot) == 1
    assert services.fence_next(robot, 10) == 11
    assert services.fence_next(robot, 3) == 12


@pytest.mark.django_db(transaction=True)
def test_no_fence_is_given_twice(robot: Robot) -> None:
    ready = threading.Barrier(8)

    def take_five(_: int) -> list[int]:
        ready.wait()
        try:
            return [services.fence_next(robot) for _ in range(5)]
        finally:
            connections.close_all()

    with ThreadPoolExecutor(8) as pool:
        given = [fence for fences in pool.map(take_five, range(8)) for fence in fences]
    assert sorted(given) == list(range(1, 41))


@pytest.mark.django_db
def test_a_profile_is_recorded_and_can_be_taken_back_as_shipped(tiago: RobotProfile, staff: User) -> None:
    tiago.blind_mps = 0.1
    services.profile_save(profile=tiago, actor=staff)
    change: dict[str, Any] = {"field": "blind_mps", "from": 0.3, "to": 0.1}
    assert last_record().parameters == {"profile": "tiago", "changes": [change]}
    assert services.profile_take_shipped(profile=tiago, actor=staff)
    tiago.refresh_from_db()
    assert tiago.blind_mps == 0.3


@pytest.mark.django_db
def test_the_status_of_a_bridge_is_kept_once_per_robot(robot: Robot) -> None:
    for state in (BridgeStatus.State.STARTING, BridgeStatus.State.RUNNING):
        services.bridge_status_set(robot_id=robot.id, state=state, detail="", pid=7)
    assert BridgeStatus.objects.get().state == BridgeStatus.State.RUNNING
