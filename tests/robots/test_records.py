"""What a bridge has to say ends up in the audit log, or the bridge is told that it does not."""

from __future__ import annotations

import uuid
from unittest import mock

import pytest

from fleet.accounts.models import User
from fleet.audit import AuditUnavailable
from fleet.audit.models import Record
from robots.bridge.gate.values import STILL, Velocity, Verdict
from robots.bridge.sink import DriveSummary, GateSummary, Holder, RecordError
from robots.models import Robot
from robots.records import AuditSink
from robots.wire import Grant
from tests.bridge.support import Bench
from tests.disk import Disk

pytestmark = pytest.mark.django_db(transaction=True)  # the sink opens a connection of its own each time

SUMMARY = DriveSummary(
    distance_m=3.14159, duration_s=12.5, top_mps=0.4, top_radps=0.1, interventions=1, ended_by="standstill"
)
HELD = Verdict(
    velocity=Velocity(0.2, 0.0, 0.0),
    asked=Velocity(0.4, 0.0, 0.0),
    code="obstacle",
    text="slowed to 0.2 m/s: laser, 0.6 m ahead",
    sensor="/scan_raw",
    distance_m=0.6123,
    bearing=0.1,
    side="ahead",
)


@pytest.fixture
def sink(robot: Robot) -> AuditSink:
    return AuditSink(robot.id, robot.name)


@pytest.fixture
def holder(operator: User) -> Holder:
    return Holder(holder_id=str(operator.pk), holder="Olga Operator", session=str(uuid.uuid4()), fence=5)


def test_what_is_asked_of_the_robot_is_a_request_and_its_outcome(
    sink: AuditSink, holder: Holder, robot: Robot
) -> None:
    motion = sink.request(holder, "motion.start", {"motion": "wave"})
    came_of_it = {"motion": "wave", "duration_s": 1.5, "text": "The arm would sweep it."}
    sink.outcome(motion, holder, "motion.end", "intruder", came_of_it)
    start, end = Record.objects.filter(robot_id=robot.pk).order_by("id")
    assert (start.kind, start.parameters) == ("motion.start", {"motion": "wave"})
    assert (end.kind, end.of_id, end.outcome) == ("motion.end", start.pk, "intruder")
    assert end.parameters == came_of_it
    assert start.fence == end.fence == 5


def test_a_drive_is_a_start_interventions_and_an_end(sink: AuditSink, holder: Holder, robot: Robot) -> None:
    drive = sink.begin_drive(holder)
    intervention = sink.begin_gate(drive, holder, HELD)
    sink.end_gate(intervention, holder, GateSummary(1.234, ["near_miss"]))
    sink.end_drive(drive, holder, SUMMARY)
    start, begin, end, finish = Record.objects.filter(robot_id=robot.pk).order_by("id")
    assert [start.kind, begin.kind, end.kind, finish.kind] == [
        "drive.start",
        "gate.begin",
        "gate.end",
        "drive.end",
    ]
    assert [begin.of_id, end.of_id, finish.of_id] == [start.pk, begin.pk, start.pk]
    assert {record.robot_id for record in (start, begin, end, finish)} == {robot.id}
    assert {str(record.session_id) for record in (start, begin, end, finish)} == {holder.session}
    assert (start.actor_name, start.fence) == ("Olga Operator", 5)
    assert begin.outcome == "obstacle"
    assert begin.parameters == {
        "text": "slowed to 0.2 m/s: laser, 0.6 m ahead",
        "sensor": "/scan_raw",
        "distance_m": 0.612,
        "bearing": 0.1,
        "side": "ahead",
        "asked": {"vx_mps": 0.4, "vy_mps": 0.0, "w_radps": 0.0},
        "allowed": {"vx_mps": 0.2, "vy_mps": 0.0, "w_radps": 0.0},
    }
    assert end.parameters == {"duration_s": 1.23, "also": ["near_miss"]}
    assert (finish.outcome, finish.parameters["distance_m"]) == ("standstill", 3.142)


def test_what_cannot_be_written_is_told_in_words(sink: AuditSink, holder: Holder) -> None:
    full = AuditUnavailable(
        "audit_disk_full", "Not done, because it could not be recorded: the disk is full."
    )
    with mock.patch("robots.records.record", autospec=True, side_effect=full):
        with pytest.raises(RecordError, match="the disk is full"):
            sink.begin_drive(holder)
        with pytest.raises(RecordError, match="the disk is full"):
            sink.end_drive(1, holder, SUMMARY)
    assert sink.begin_drive(holder)


def test_a_session_that_is_none_is_an_error_of_the_record_and_not_of_the_bridge(sink: AuditSink) -> None:
    odd = Holder(holder_id="nobody", holder="Nobody", session="not a session", fence=1)
    with pytest.raises(RecordError):
        sink.begin_gate(1, odd, HELD._replace(velocity=STILL))


def test_on_a_full_disk_a_drive_is_not_recorded_and_says_why(
    sink: AuditSink, holder: Holder, disk: Disk
) -> None:
    disk.fill()
    with pytest.raises(RecordError, match="the disk of the database is full"):
        sink.begin_drive(holder)
    disk.free()
    assert Record.objects.get(pk=sink.begin_drive(holder)).kind == "drive.start"


def test_on_a_full_disk_nothing_moves_until_there_is_room_again(
    sink: AuditSink, holder: Holder, disk: Disk
) -> None:
    bench = Bench(sink=sink).online()
    try:
        grant = Grant(1, 60.0, holder.session, holder.holder, holder.holder_id, 1.0)
        bench.core.grant(grant, 1, bench.now_s)
        bench.stick(0.0)
        disk.fill()
        bench.stick(0.5)
        bench.recorded()
        bench.pass_time(0.1)
        refusal = bench.stick(0.5)
        assert refusal is not None and refusal.code == "not_recorded"
        assert "the disk of the database is full" in refusal.text
        assert set(bench.base.sent) == {STILL}
        assert not Record.objects.filter(kind="drive.start").exists()
        disk.free()
        bench.pass_time(1.0)
        bench.stick(0.0)
        bench.driving()
    finally:
        bench.drives.close(bench.now_s)
