"""The audit log records the reports of a bridge, or the bridge receives an error."""

from __future__ import annotations

import sqlite3
import uuid
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from unittest import mock

import pytest
from django.db import connection, connections

from fleet.accounts.models import User
from fleet.audit.errors import AuditUnavailable
from fleet.audit.models import Record
from fleet.audit.services import record
from robots.records.bridge_records import AuditSink
from robots.registry.models import BridgePulse, Robot
from robots.shared.geometry.poses import STILL, Pose, Velocity
from robots.shared.records.record_sink import (
    BadRecord,
    DriveSummary,
    GateStart,
    GateSummary,
    Holder,
    Position,
    RecordError,
    Sample,
)
from robots.shared.records.verdict import Verdict
from robots.shared.wire import Grant, Refusal
from tests.bridge.support import Bench
from tests.full_disk import Disk

pytestmark = pytest.mark.django_db(transaction=True)  # the sink opens a new database connection each time

HELD = Verdict(
    velocity=Velocity(0.2, 0.0, 0.0),
    asked=Velocity(0.4, 0.0, 0.0),
    code="obstacle",
    text="slowed to 0.2 m/s: laser, 0.6 m ahead",
    sensor="/scan_raw",
    distance_m=0.6123,
    bearing_rad=0.1,
    side="ahead",
)
FIGURES_OF_HELD = {
    "sensor": "/scan_raw",
    "distance_m": 0.612,
    "bearing_rad": 0.1,
    "side": "ahead",
    "asked": {"vx_mps": 0.4, "vy_mps": 0.0, "w_radps": 0.0},
    "allowed": {"vx_mps": 0.2, "vy_mps": 0.0, "w_radps": 0.0},
}
START = Position(Pose(1.0, 2.0, 0.5), Pose(10.0, 0.0, 0.0))
END = Position(Pose(4.14159, 2.0, 0.5), None)
SUMMARY = DriveSummary(
    outcome="halted",
    ended_by="Ann took over.",
    end=END,
    distance_m=3.14159,
    duration_s=12.5,
    top_mps=0.4,
    top_radps=0.1,
    interventions=1,
    path=[Sample(0.0, 1.0, 2.0, 0.5, 0.0), Sample(12.5, 4.14159, 2.0, 0.5, 0.0)],
    tolerance_m=0.05,
)


@pytest.fixture
def sink(robot: Robot) -> AuditSink:
    return AuditSink(robot.id, robot.name)


@pytest.fixture
def holder(operator: User) -> Holder:
    return Holder(holder_id=str(operator.pk), holder="Olga Operator", session=str(uuid.uuid4()), fence=5)


def records_of(robot: Robot) -> list[Record]:
    return list(Record.objects.filter(robot_id=robot.pk).order_by("id"))


def test_each_task_is_recorded_as_request_and_outcome(sink: AuditSink, holder: Holder, robot: Robot) -> None:
    motion = sink.request(holder, "motion.start", {"motion": "wave"})
    came_of_it = {"motion": "wave", "duration_s": 1.5, "text": "Cancelled by Ann."}
    sink.outcome(motion, holder, "motion.end", "cancelled", came_of_it)
    start, end = records_of(robot)
    assert (start.kind, start.parameters) == ("motion.start", {"motion": "wave"})
    assert (end.kind, end.of_id, end.outcome) == ("motion.end", start.pk, "cancelled")
    assert start.fence == end.fence == 5
    assert end.parameters == {"motion": "wave", "duration_s": 1.5}
    assert end.content.data == {"words": "Cancelled by Ann."}


def test_words_can_expire_and_plain_facts_stay(sink: AuditSink, holder: Holder, robot: Robot) -> None:
    sink.request(holder, "speech.start", {"text": "Hello, Ann", "language": "en-GB", "topic": "/tts"})
    sink.request(holder, "publish.start", {"topic": "/note", "rate_hz": 0.0, "fields": '{"data": "Ann"}'})
    speech, message = records_of(robot)
    assert speech.parameters == {"language": "en-GB", "topic": "/tts"}
    assert (speech.content.text, speech.content.data) == ("Hello, Ann", {})
    assert message.parameters == {"topic": "/note", "rate_hz": 0.0}
    assert (message.content.text, message.content.data) == ("", {"fields": '{"data": "Ann"}'})


def test_a_drive_is_a_start_interventions_and_an_end(sink: AuditSink, holder: Holder, robot: Robot) -> None:
    drive = sink.begin_drive(holder, START)
    intervention = sink.begin_gate(drive, holder, GateStart(HELD, 3.456, Pose(2.0, 2.0, 0.5)))
    nearer = HELD._replace(distance_m=0.4)
    sink.end_gate(intervention, holder, GateSummary(1.234, ["near_miss"], nearer, Pose(2.1, 2.0, 0.5)))
    sink.end_drive(drive, holder, SUMMARY)
    records = records_of(robot)
    assert [found.kind for found in records] == ["drive.start", "gate.begin", "gate.end", "drive.end"]
    start, begin, end, finish = records
    assert [begin.of_id, end.of_id, finish.of_id] == [start.pk, begin.pk, start.pk]
    assert {(str(found.session_id), found.fence) for found in records} == {(holder.session, 5)}
    assert {found.actor_name for found in records} == {"Olga Operator"}
    figures = {"distance_m": 3.142, "duration_s": 12.5, "top_mps": 0.4, "top_radps": 0.1, "interventions": 1}
    assert [found.parameters for found in records] == [{}, {}, {}, figures]  # other fields may expire
    assert [found.outcome for found in records] == ["", "obstacle", "", "halted"]
    assert start.content.data == {"pose": [1.0, 2.0, 0.5], "map_to_odom": [10.0, 0.0, 0.0]}
    assert begin.content.data == FIGURES_OF_HELD | {
        "words": "slowed to 0.2 m/s: laser, 0.6 m ahead",
        "t_s": 3.46,
        "pose": [2.0, 2.0, 0.5],
    }
    assert end.content.data == {
        "duration_s": 1.23,
        "also": ["near_miss"],
        "nearest": FIGURES_OF_HELD | {"distance_m": 0.4},
        "pose": [2.1, 2.0, 0.5],
    }
    assert finish.content.data == {
        "words": "Ann took over.",
        "path": [[0.0, 1.0, 2.0, 0.5, 0.0], [12.5, 4.142, 2.0, 0.5, 0.0]],
        "path_tolerance_m": 0.05,
        "pose": [4.142, 2.0, 0.5],
        "map_to_odom": None,
    }


def test_a_stop_that_reached_the_robot_is_in_its_session(
    sink: AuditSink, holder: Holder, robot: Robot
) -> None:
    sink.stopped(holder, 7, False)
    sink.stopped(None, 8, True)
    held, free = records_of(robot)
    assert (held.kind, held.parameters, held.actor) == (
        "stop.latch",
        {"number": 7, "was_standing": False},
        None,
    )
    assert (str(held.session_id), held.fence) == (holder.session, 5)
    assert (free.parameters, free.session_id, free.fence) == ({"number": 8, "was_standing": True}, None, None)


def test_a_bridges_own_action_is_recorded_without_a_person(sink: AuditSink, robot: Robot) -> None:
    cancel = sink.request(None, "motion.cancel", {"topic": "/play_motion", "goal": "fleet_bridge-7-left"})
    sink.outcome(cancel, None, "motion.cancel", "cancelled", {})
    asked, end = records_of(robot)
    assert (asked.actor, asked.session_id, asked.fence, asked.outcome) == (None, None, None, "")
    assert (end.actor, end.of_id, end.outcome) == (None, asked.pk, "cancelled")


def test_the_next_bridge_knows_parts_that_are_ill_on_record(
    sink: AuditSink, robot: Robot, other_robot: Robot
) -> None:
    def change(kind: str, part: str, to: str, to_sink: AuditSink = sink) -> None:
        to_sink.request(None, kind, {"part": part, "from": "ok", "to": to, "text": f"{part}: words"})

    change("health.worse", "Speakers", "error")
    change("health.worse", "Arm", "warning")
    change("health.better", "Speakers", "ok")
    change("health.worse", "Arm", "error")
    change("health.worse", "Laser", "silent", AuditSink(other_robot.id, other_robot.name))
    assert sink.ill_parts() == {"Arm": "error"}
    newest = records_of(robot)[-1]
    assert (newest.actor, newest.content.text) == (None, "Arm: words")
    assert newest.parameters == {"part": "Arm", "from": "ok", "to": "error"}


# --- a bridge that was killed ------------------------------------------------------------------------


def test_the_next_bridge_ends_open_tasks_once(sink: AuditSink, holder: Holder, robot: Robot) -> None:
    done = sink.request(holder, "speech.start", {"text": "Done"})
    sink.outcome(done, holder, "speech.end", "succeeded", {})
    drive = sink.begin_drive(holder, START)
    gate = sink.begin_gate(drive, holder, GateStart(HELD, 1.0, None))
    speech = sink.request(holder, "speech.start", {"text": "Hello"})
    motion = sink.request(holder, "motion.start", {"motion": "wave"})
    look = sink.request(holder, "head.look_ahead", {})
    forget = sink.request(holder, "memory.forget", {})
    metre = sink.request(holder, "drive.by", {"distance_m": 1.0, "speed_mps": 0.4})
    chosen = sink.request(holder, "topic.choose", {"use": "speech"})
    sink.outcome(chosen, holder, "topic.choose", "chosen", {})
    record("motion.cancel", robot_id=robot.pk, outcome="accepted")  # complete: the web process writes it
    before = len(records_of(robot))
    sink.settle()
    ends = records_of(robot)[before:]
    assert [(end.kind, end.of_id, end.outcome) for end in ends] == [
        ("drive.by", metre, "unknown"),
        ("memory.forget", forget, "unknown"),
        ("head.look_ahead", look, "unknown"),
        ("motion.end", motion, "unknown"),
        ("speech.end", speech, "unknown"),
        ("gate.end", gate, "bridge_killed"),
        ("drive.end", drive, "bridge_killed"),
    ]
    assert {(str(end.session_id), end.fence, end.robot_name) for end in ends} == {
        (holder.session, 5, robot.name)
    }
    sink.settle()
    assert len(records_of(robot)) == before + 7


def test_so_is_what_it_had_begun_to_cancel_by_itself(sink: AuditSink, robot: Robot) -> None:
    cancel = sink.request(None, "motion.cancel", {"topic": "/play_motion", "goal": "fleet_bridge-7-left"})
    sink.settle()
    end = records_of(robot)[-1]
    assert (end.kind, end.of_id, end.outcome, end.actor) == ("motion.cancel", cancel, "unknown", None)


def test_a_bridge_settles_its_own_robot_and_no_other(
    sink: AuditSink, holder: Holder, robot: Robot, other_robot: Robot
) -> None:
    AuditSink(other_robot.id, other_robot.name).begin_drive(holder, START)
    sink.settle()
    assert records_of(robot) == []
    assert [found.kind for found in records_of(other_robot)] == ["drive.start"]


def test_a_settling_looks_no_farther_back_than_the_one_before(
    sink: AuditSink, holder: Holder, robot: Robot
) -> None:
    sink.settle()
    sink.begin_drive(holder, START)
    sink.settle()
    assert BridgePulse.objects.get(robot=robot).settled == records_of(robot)[-1].pk
    BridgePulse.objects.update(settled=sink.begin_drive(holder, START))
    sink.settle()
    assert [found.kind for found in records_of(robot)] == ["drive.start", "drive.end", "drive.start"]


def test_a_settling_that_fails_midway_leaves_nothing_half_done(
    sink: AuditSink, holder: Holder, robot: Robot
) -> None:
    sink.begin_drive(holder, START)
    sink.request(holder, "motion.start", {"motion": "wave"})
    full = [record, mock.Mock(side_effect=AuditUnavailable("audit_disk_full", "The disk is full."))]
    written = mock.patch(
        "robots.records.bridge_records.record", lambda *args, **facts: full.pop(0)(*args, **facts)
    )
    with written, pytest.raises(RecordError):
        sink.settle()
    assert full == []
    assert len(records_of(robot)) == 2
    sink.settle()
    assert [found.kind for found in records_of(robot)][2:] == ["motion.end", "drive.end"]


# --- a missing database ------------------------------------------------------------------------------


def test_a_pulse_is_written_and_is_no_record(sink: AuditSink, robot: Robot) -> None:
    sink.test_writable()
    first = BridgePulse.objects.get(robot=robot).at
    sink.test_writable()
    assert BridgePulse.objects.get(robot=robot).at > first
    assert records_of(robot) == []


def test_a_failed_write_is_explained_in_words(sink: AuditSink, holder: Holder) -> None:
    full = AuditUnavailable(
        "audit_disk_full", "Not done, because it could not be recorded: the disk is full."
    )
    with mock.patch("robots.records.bridge_records.record", autospec=True, side_effect=full):
        with pytest.raises(RecordError, match="the disk of the database is full"):
            sink.begin_drive(holder, START)
        with pytest.raises(RecordError, match="the disk of the database is full"):
            sink.end_drive(1, holder, SUMMARY)
    assert sink.begin_drive(holder, START)


def test_a_missing_session_is_an_error_of_the_record(sink: AuditSink) -> None:
    odd = Holder(holder_id="nobody", holder="Nobody", session="not a session", fence=1)
    with pytest.raises(BadRecord):
        sink.begin_gate(1, odd, GateStart(HELD, 0.0, None))


def test_on_a_full_disk_a_drive_is_not_recorded_and_says_why(
    sink: AuditSink, holder: Holder, disk: Disk
) -> None:
    disk.fill()
    with pytest.raises(RecordError, match="the disk of the database is full"):
        sink.begin_drive(holder, START)
    disk.free()
    assert Record.objects.get(pk=sink.begin_drive(holder, START)).kind == "drive.start"


@contextmanager
def kept_connection(**changes: str) -> Iterator[None]:
    """This thread keeps its connection, with these settings. Other threads share the settings, so they are copied.

    Regression: a thread that connected meanwhile kept a connection to a file that was gone by the next tests.
    """
    changed = {**connection.settings_dict, "CONN_MAX_AGE": None, **changes}
    with mock.patch.object(connections["default"], "settings_dict", changed):
        yield


def test_a_kept_connection_is_renewed_after_a_failure(sink: AuditSink, holder: Holder) -> None:
    with kept_connection():
        connection.close()
        sink.begin_drive(holder, START)
        kept = connection.connection
        sink.begin_drive(holder, START)
        assert connection.connection is kept
        full = AuditUnavailable("audit_disk_full", "The disk is full.")
        with (
            mock.patch("robots.records.bridge_records.record", side_effect=full),
            pytest.raises(RecordError),
        ):
            sink.begin_drive(holder, START)
        sink.begin_drive(holder, START)
        assert connection.connection is not kept
    connection.close()


def test_a_kept_connection_never_writes_to_a_replaced_file(
    sink: AuditSink, holder: Holder, tmp_path: Path
) -> None:
    if connection.vendor != "sqlite":
        pytest.skip("of SQLite's files")
    tested, file, other = connection.settings_dict["NAME"], tmp_path / "fleet.sqlite3", tmp_path / "other"

    def copied(to: Path) -> None:
        with closing(sqlite3.connect(tested)) as source, closing(sqlite3.connect(to)) as target:
            source.backup(target)

    def held(number: int) -> bool:
        with closing(sqlite3.connect(file)) as reader:
            return bool(reader.execute("SELECT 1 FROM audit_record WHERE id = ?", [number]).fetchall())

    copied(file)
    connection.close()
    with kept_connection(NAME=str(file)):
        sink.begin_drive(holder, START)
        kept = connection.connection
        assert held(sink.begin_drive(holder, START))
        assert connection.connection is kept
        copied(other)
        other.replace(file)
        assert held(sink.begin_drive(holder, START))
        kept = connection.connection
        Path(f"{file}-wal").unlink()
        assert held(sink.begin_drive(holder, START))
        assert connection.connection is not kept
        kept = connection.connection
        assert held(sink.begin_drive(holder, START))
        assert connection.connection is kept
        file.unlink()
        for _ in range(2):
            with pytest.raises(RecordError, match="the file of the database is gone"):
                sink.begin_drive(holder, START)
        assert not file.exists()
        copied(file)
        assert held(sink.begin_drive(holder, START))
        connection.close()


@contextmanager
def locked_database() -> Iterator[None]:
    """Hold the database's write lock, like another process."""
    other = connection.copy()
    try:
        with other.cursor() as cursor:
            if connection.vendor == "sqlite":
                cursor.execute("BEGIN IMMEDIATE")
            else:
                other.set_autocommit(False)
                cursor.execute("LOCK TABLE audit_record, robots_bridgepulse IN ACCESS EXCLUSIVE MODE")
            yield
    finally:
        other.close()


@pytest.fixture
def bench(sink: AuditSink, holder: Holder) -> Iterator[Bench]:
    """A drivable robot whose records go to the database."""
    bench = Bench(sink=sink).online()
    bench.records.open(lambda: None, bench.now_s)
    bench.recorded()
    grant = Grant(1, 60.0, holder.session, holder.holder, holder.holder_id, 1.0)
    bench.core.grant(grant, 1, bench.now_s)
    bench.stick(0.0)
    yield bench
    bench.close()


def held_stick(bench: Bench, seconds: float) -> Refusal | None:
    """Hold the stick for this number of seconds; return the last answer."""
    refusal = None
    for _ in range(round(seconds / 0.05)):
        refusal = bench.stick(0.5)
        bench.pass_time(0.05)
    return refusal


def test_on_a_full_disk_nothing_moves_until_there_is_space(bench: Bench, disk: Disk) -> None:
    disk.fill()
    bench.stick(0.5)
    bench.recorded()
    refusal = bench.stick(0.5)
    assert refusal is not None
    assert refusal.code == "not_recorded"
    assert "the disk of the database is full" in refusal.text
    held_stick(bench, 0.2)
    assert set(bench.base.sent) == {STILL}
    assert not Record.objects.filter(kind="drive.start").exists()
    disk.free()
    bench.pass_time(1.0)
    bench.stick(0.0)
    bench.driving()


def test_a_disk_that_fills_in_a_drive_stops_it_without_loss(bench: Bench, robot: Robot, disk: Disk) -> None:
    bench.driving()
    disk.fill()
    bench.gate.says = lambda _asked: HELD
    refusal = held_stick(bench, 2.7)
    assert refusal is not None
    assert refusal.code == "not_recorded"
    assert bench.last == STILL
    bench.odometry(STILL)
    bench.pass_time(1.0)
    disk.free()
    bench.pass_time(1.0)
    kinds = [found.kind for found in records_of(robot)]
    assert kinds == ["drive.start", "gate.begin", "gate.end", "drive.end"]


def test_a_locked_database_stops_the_robot_until_it_is_free(bench: Bench, robot: Robot) -> None:
    bench.driving()
    bench.pass_time(0.2)
    bench.stick(0.5)
    bench.sink.open.clear()  # the bench does not wait for records
    with locked_database():
        refusal = held_stick(bench, 3.0)
        assert refusal is not None
        assert refusal.code == "not_recorded"
        assert bench.last == STILL
    bench.sink.open.set()
    bench.odometry(STILL)
    bench.pass_time(1.0)
    assert [found.kind for found in records_of(robot)] == ["drive.start", "drive.end"]
    assert records_of(robot)[-1].content.data["words"] == "the robot’s actions could not be recorded"
    bench.stick(0.0)
    bench.driving()
