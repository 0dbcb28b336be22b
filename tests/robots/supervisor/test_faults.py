"""The begins and ends of faults of bridges and robots are recorded."""

from __future__ import annotations

import pytest

from fleet.audit.models import Record
from robots.link.client import LinkRefused
from robots.records import faults
from robots.records.faults import (
    BRIDGE,
    ROBOT,
    SURE_AFTER,
    Condition,
    RobotWatch,
    condition_of,
    record_bridge,
    record_part,
)
from robots.registry.models import BridgeStatus, Robot
from robots.registry.selectors import link_address
from robots.shared.wire import Refusal
from tests.processes import until

State = BridgeStatus.State
OFFLINE = Condition("robot_offline", "The master does not answer.")
WELL = Condition()

pytestmark = pytest.mark.django_db


def recorded(robot: Robot) -> list[tuple[str, str]]:
    """Return parts and outcomes of the recorded faults, oldest first."""
    records = Record.objects.filter(robot_id=robot.id, kind="fault").order_by("id")
    return [(record.parameters["part"], record.outcome) for record in records]


def test_a_fault_and_its_end_are_reported_once(robot: Robot) -> None:
    for condition in (WELL, OFFLINE, OFFLINE, Condition("bridge_down"), WELL, WELL):
        record_part(robot.id, ROBOT, condition)
    assert recorded(robot) == [(ROBOT, "robot_offline"), (ROBOT, "over")]
    fault, over = Record.objects.filter(kind="fault").order_by("id")
    assert fault.details["words"] == OFFLINE.words
    assert over.of_id == fault.pk and over.parameters["duration_s"] >= 0.0


def test_each_part_and_each_robot_has_its_own_faults(robot: Robot, other_robot: Robot) -> None:
    record_part(robot.id, ROBOT, OFFLINE)
    record_part(robot.id, BRIDGE, Condition("bridge_ended"))
    record_part(other_robot.id, ROBOT, OFFLINE)
    record_part(robot.id, ROBOT, WELL)
    assert recorded(robot) == [(ROBOT, "robot_offline"), (BRIDGE, "bridge_ended"), (ROBOT, "over")]
    assert recorded(other_robot) == [(ROBOT, "robot_offline")]


def test_a_bridge_that_falls_again_and_again_is_one_fault(robot: Robot) -> None:
    for _ in range(3):
        record_bridge(robot.id, State.STARTING, "")
        record_bridge(robot.id, State.BACKING_OFF, "ended by itself with code 7; next start in 0.5 s")
    record_bridge(robot.id, State.STARTING, "")
    record_bridge(robot.id, State.RUNNING, "")
    assert recorded(robot) == [(BRIDGE, "bridge_ended"), (BRIDGE, "over")]


def test_a_robot_that_is_gone_from_the_registry_has_no_faults(robot: Robot) -> None:
    gone = robot.id
    robot.delete()
    record_part(gone, ROBOT, OFFLINE)
    assert not Record.objects.filter(kind="fault").exists()


@pytest.mark.parametrize(("phase", "fault"), [("online", ""), ("waiting", "robot_offline")])
def test_a_robots_condition_is_what_its_bridge_says(
    robot: Robot, monkeypatch: pytest.MonkeyPatch, phase: str, fault: str
) -> None:
    class State:
        text = "So it is."

    State.phase = phase  # type: ignore[attr-defined]
    monkeypatch.setattr(faults, "state_once", lambda *_: State)
    assert condition_of(robot.id, link_address(robot)).fault == fault


def test_a_bridge_that_does_not_answer_is_a_fault_too(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise LinkRefused(Refusal("bridge_down", "It is not running.", "robot"))

    monkeypatch.setattr(faults, "state_once", refuse)
    assert condition_of(robot.id, link_address(robot)) == Condition("bridge_down", "It is not running.")


def test_only_an_absent_robot_is_at_fault_a_hung_one_is_not(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = [OFFLINE, WELL, *[OFFLINE] * SURE_AFTER, WELL]
    monkeypatch.setattr(faults, "condition_of", lambda *_: answers.pop(0))
    watch = RobotWatch()
    for look in range(len(answers)):
        assert recorded(robot) == ([] if look < 5 else [(ROBOT, "robot_offline")])
        watch.step(look * faults.CHECK_S)
        until(lambda: watch._asked[robot.id].done(), "an answer")
        watch.step(look * faults.CHECK_S)
    assert recorded(robot) == [(ROBOT, "robot_offline"), (ROBOT, "over")]
