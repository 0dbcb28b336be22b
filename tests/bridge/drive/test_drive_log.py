"""Records of a drive: its path, its gate interventions, and failures of the database."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest

from robots.shared.geometry.poses import STILL, Pose, Velocity
from robots.shared.records.record_sink import DriveSummary, GateStart, GateSummary, Position
from robots.shared.records.verdict import Verdict
from robots.shared.wire import Refusal
from tests.bridge.support import Bench

FORWARD = Velocity(0.5, 0.0, 0.0)


@pytest.fixture
def bench() -> Iterator[Bench]:
    bench = Bench().online().granted()
    yield bench
    bench.sink.open.set()
    bench.close()


def rolls(bench: Bench, seconds: float, speed: Velocity = FORWARD, stick: float = 0.5) -> None:
    """Send the stick 20 times a second, to a robot that obeys at once."""
    bench.speed = speed
    for _ in range(round(seconds / 0.05)):
        bench.stick(stick)
        bench.x += speed.vx * 0.05
        bench.pass_time(0.05)


def stands(bench: Bench) -> None:
    rolls(bench, 1.0, STILL, stick=0.0)


def records_of(bench: Bench, kind: str) -> list[object]:
    bench.recorded()
    return [what for name, what in bench.sink.records if name == kind]


def drive_of(bench: Bench) -> DriveSummary:
    (summary,) = records_of(bench, "drive.end")
    assert isinstance(summary, DriveSummary)
    return summary


# --- path -----------------------------------------------------------------------------------------


def test_a_drive_has_its_path_start_and_end(bench: Bench) -> None:
    bench.x = 2.0
    bench.odometry()
    bench.driving()
    rolls(bench, 10.0)
    stands(bench)
    summary = drive_of(bench)
    first, last = summary.path[0], summary.path[-1]
    assert (first.t_s, first.x, first.speed) == (0.0, 2.0, 0.0)
    assert (last.x, last.speed) == (pytest.approx(7.0), 0.0)
    assert last.t_s == pytest.approx(summary.duration_s, abs=0.06)
    assert summary.distance_m == pytest.approx(5.0)
    assert summary.end.pose == Pose(bench.x, 0.0, 0.0)
    assert (summary.top_mps, summary.interventions) == (0.5, 0)
    assert (summary.outcome, summary.ended_by) == ("standstill", "standstill")


def test_bridge_end_ends_and_records_the_drive(bench: Bench) -> None:
    bench.driving()
    rolls(bench, 1.0)
    bench.core.close(bench.now_s)
    summary = drive_of(bench)
    assert (summary.outcome, summary.ended_by) == ("bridge_ended", "the bridge ended")


def test_a_path_is_no_longer_than_its_corners_need(bench: Bench) -> None:
    bench.driving()
    rolls(bench, 120.0)
    stands(bench)
    assert len(drive_of(bench).path) <= 6


def test_a_path_of_minutes_is_simplified_while_it_is_driven(bench: Bench) -> None:
    bench.driving()
    rolls(bench, 100.0)
    drive = bench.drives._drive
    assert drive is not None
    assert len(drive.track.fresh) < 120
    assert drive.path.samples


def test_yaw_is_counted_on_beyond_a_full_turn(bench: Bench) -> None:
    bench.driving()
    for eighth in range(24):
        bench.now_s += 0.25
        bench.stamp_s += 0.25
        pose = Pose(0.0, 0.0, math.remainder(eighth * math.pi / 4, math.tau))
        bench.core.odometry(bench.stamp_s, bench.now_s, pose, STILL, bench.stamp_s)
    bench.drives.end_drive("standstill", "", bench.now_s)
    assert drive_of(bench).path[-1].yaw == pytest.approx(23 * math.pi / 4)


def test_drive_records_map_to_odom_at_begin_and_end(bench: Bench) -> None:
    bench.map_to_odom = Pose(1.0, 2.0, 0.1)
    bench.driving()
    bench.map_to_odom = Pose(1.1, 2.0, 0.1)
    rolls(bench, 1.0)
    stands(bench)
    (start,) = records_of(bench, "drive.start")
    assert start == Position(Pose(0.0, 0.0, 0.0), Pose(1.0, 2.0, 0.1))
    assert drive_of(bench).end.map_to_odom == Pose(1.1, 2.0, 0.1)


def test_drive_ended_by_another_cause_records_the_cause(bench: Bench) -> None:
    bench.driving()
    bench.core.stop("Bob", "a child", bench.now_s)
    stands(bench)
    summary = drive_of(bench)
    assert (summary.outcome, summary.ended_by) == ("halted", "the robot was stopped")


def test_a_drive_in_another_persons_control_is_a_new_one(bench: Bench) -> None:
    bench.driving()
    bench.granted(fence=2)
    bench.speed = FORWARD
    bench.stick(0.5, fence=2)
    bench.recorded()
    assert bench.sink.kinds == ["drive.start", "drive.end", "drive.start"]
    assert drive_of(bench).outcome == "control_changed"


# --- gate interventions ---------------------------------------------------------------------------


def test_intervention_records_time_place_and_nearest_obstacle(bench: Bench) -> None:
    bench.driving()
    rolls(bench, 2.0)
    distances = iter([0.5, 0.3, 0.4])
    slow = Velocity(0.1, 0.0, 0.0)
    bench.gate.says = lambda asked: Verdict(slow, asked, "obstacle", "slowed", "laser", next(distances))
    rolls(bench, 0.05)
    bench.gate.says = None
    rolls(bench, 1.5)
    (start,), (end,) = records_of(bench, "gate.begin"), records_of(bench, "gate.end")
    assert isinstance(start, GateStart)
    assert isinstance(end, GateSummary)
    assert start.t_s == pytest.approx(2.0, abs=0.11)
    assert start.pose is not None
    assert start.pose.x == pytest.approx(1.0, abs=0.06)
    assert start.verdict.distance_m == 0.5
    assert end.nearest.distance_m == 0.3
    assert end.pose is not None
    assert end.pose.x == pytest.approx(start.pose.x, abs=0.06)


# --- unwritable database --------------------------------------------------------------------------


def driven_while_away(bench: Bench, seconds: float) -> list[Refusal | None]:
    """Send the stick for some time, while the drive needs no new record; return the refusals."""
    answers = []
    for _ in range(round(seconds / 0.05)):
        answers.append(bench.stick(0.5))
        bench.pass_time(0.05)
    return answers


def test_database_is_tested_during_a_long_drive(bench: Bench) -> None:
    bench.driving()
    rolls(bench, 10.0)
    assert bench.sink.kinds == ["drive.start"]
    assert 18 <= bench.sink.pulses <= 21


def test_database_is_not_tested_after_the_drive(bench: Bench) -> None:
    bench.driving()
    stands(bench)
    pulses = bench.sink.pulses
    bench.pass_time(5.0)
    assert bench.sink.pulses == pulses


@pytest.mark.parametrize("hangs", [False, True])
def test_unwritable_database_stops_the_robot_after_two_seconds(bench: Bench, hangs: bool) -> None:
    bench.driving()
    bench.pass_time(0.1)
    bench.stick(0.5)
    if hangs:
        bench.sink.open.clear()
    else:
        bench.sink.fails = "the disk is full"
    assert set(driven_while_away(bench, 1.9)) == {None}
    assert bench.last == FORWARD
    refused = driven_while_away(bench, 0.8)[-1]
    assert refused is not None
    assert (refused.code, refused.rule) == ("not_recorded", "audit")
    assert ("no answer" if hangs else "the disk is full") in refused.text
    assert bench.last == STILL
    assert bench.core.state(bench.now_s, []).verdict.code == "not_recorded"


def test_driving_resumes_from_neutral_when_database_is_back(
    bench: Bench,
) -> None:
    bench.driving()
    bench.sink.fails = "locked"
    driven_while_away(bench, 3.0)
    bench.sink.fails = None
    answers = driven_while_away(bench, 1.0)
    assert answers[-1] is not None
    assert answers[-1].code == "neutral_needed"
    assert "could not be recorded" in answers[-1].text
    assert bench.last == STILL
    bench.stick(0.0)
    bench.driving()


def test_stick_held_during_failed_recording_moves_nothing_later(bench: Bench) -> None:
    bench.sink.fails = "locked"
    driven_while_away(bench, 3.0)
    bench.sink.fails = None
    driven_while_away(bench, 2.0)
    assert set(bench.base.sent) == {STILL}


def test_hanging_start_record_is_one_drive_with_a_reason(bench: Bench) -> None:
    bench.sink.open.clear()
    refused = driven_while_away(bench, 3.0)[-1]
    assert refused is not None
    assert refused.code == "not_recorded"
    bench.sink.open.set()
    stands(bench)
    assert [kind for kind in bench.sink.kinds if kind.startswith("drive")] == ["drive.start", "drive.end"]


def test_kept_events_are_recorded_in_order_later(bench: Bench) -> None:
    bench.driving()
    bench.gate.says = lambda asked: Verdict(Velocity(0.1, 0, 0), asked, "obstacle", "slowed")
    bench.sink.fails = "locked"
    driven_while_away(bench, 4.0)
    bench.odometry(STILL)
    bench.pass_time(2.0)
    assert bench.sink.kinds == ["drive.start"]
    bench.sink.fails = None
    bench.pass_time(1.0)
    assert bench.sink.kinds == ["drive.start", "gate.begin", "gate.end", "drive.end"]
    assert drive_of(bench).ended_by == "the robot’s actions could not be recorded"


def test_stop_does_not_wait_for_its_record(bench: Bench) -> None:
    bench.driving()
    bench.sink.fails = "locked"
    bench.core.stop("Bob", "", bench.now_s)
    assert bench.last == STILL
    assert bench.core.stop_state.state == "stopping"
    bench.odometry(STILL)
    bench.pass_time(3.0)
    assert bench.sink.stops == []
    bench.sink.fails = None
    bench.pass_time(1.0)
    ((holder, number),) = bench.sink.stops
    assert holder is not None
    assert (holder.fence, number) == (1, bench.core.stop_state.number)


def test_repeated_press_is_recorded_once(bench: Bench) -> None:
    for _ in range(3):
        bench.core.stop("Bob", "", bench.now_s)
    bench.recorded()
    assert len(bench.sink.stops) == 1
    bench.core.clear(bench.core.stop_state.number, bench.now_s)
    bench.core.stop("Bob", "", bench.now_s)
    bench.recorded()
    assert len(bench.sink.stops) == 2


def test_open_records_of_an_earlier_bridge_are_settled_first(bench: Bench) -> None:
    bench.sink.fails = "locked"
    bench.records.open(lambda: None, bench.now_s)
    driven_while_away(bench, 1.0)
    bench.sink.fails = None
    bench.pass_time(1.0)
    bench.stick(0.0)
    bench.driving()
    assert bench.sink.kinds == ["settled", "drive.start"]
