"""Drives by a distance or an angle: recorded, under every rule of drive input, each with one outcome."""

import json
import math

import msgspec
import pytest

from robots.bridge.drive.drive_by import CONFIRMED_S, HELD_S
from robots.bridge.gate.sensor_limits import Fault
from robots.bridge.robot_reports import RosStatus
from robots.shared import wire
from robots.shared.geometry.poses import STILL, Pose, Velocity
from robots.shared.records.verdict import Verdict
from robots.shared.wire import DriveBy, DriveByCancel, Grant
from tests.bridge.support import Bench, codes, settled

METRE = DriveBy(1, distance_m=1.0, speed_mps=0.5, seq=7)
LEFT = DriveBy(1, angle_rad=math.pi / 2, speed_radps=1.0, seq=8)


class FollowingBench(Bench):
    """A robot that follows each twist at once, and a console that renews control every second."""

    def __init__(self):
        super().__init__()
        self.yaw = 0.0
        self.obeys = True
        self.renews_s = 1.0
        self.max_share = 1.0
        self.silent_since_s = None
        self.renewed_s = self.now_s

    def step(self, seconds=0.05):
        self.now_s += seconds
        if self.now_s - self.renewed_s > self.renews_s:
            self.renew()
        speed = self.last if self.obeys and self.base.sent else STILL
        self.x += speed.vx * seconds
        self.yaw = math.remainder(self.yaw + speed.w * seconds, math.tau)
        self.stamp_s += seconds
        pose = Pose(self.x, 0.0, self.yaw)
        self.core.odometry(self.stamp_s, self.now_s, pose, speed, self.stamp_s)
        self.core.tick(self.now_s)
        if self.sink.open.is_set():
            self.recorded()

    def renew(self):
        self.renewed_s = self.now_s
        silent_s = None if self.silent_since_s is None else self.now_s - self.silent_since_s
        grant = Grant(1, 60.0, "session-1", "Ann", "ann-id", self.max_share, silent_s=silent_s)
        self.core.grant(grant, 1, self.now_s)

    def until_end(self, seconds=30.0):
        """Let time pass until the drive ends; return its end."""
        before = self.ended
        for _ in range(round(seconds / 0.05)):
            self.step()
            if self.ended is not before:
                return self.ended
        raise AssertionError(f"no end within {seconds} s")

    def begins(self, order=METRE, seconds=1.0):
        """Begin, and drive for some time."""
        answers = self.ask(order)
        for _ in range(round(seconds / 0.05)):
            self.step()
        assert answers == [None]
        assert self.last != STILL
        return self

    @property
    def ended(self):
        return self.core.state(self.now_s, []).drive_by_ended

    @property
    def shown(self):
        return self.core.state(self.now_s, []).drive_by

    @property
    def driven_by(self):
        """The records of drives by a distance or angle."""
        return [what for kind, what in self.sink.records if kind == "drive.by"]


@pytest.fixture
def bench():
    bench = FollowingBench().online().granted()
    bench.step()
    yield bench
    bench.close()


# --- to the goal ------------------------------------------------------------------------------------


@pytest.mark.parametrize("goal", [1.0, 0.1, 5.0, -0.5])
def test_a_distance_is_driven_and_measured(bench, goal):
    assert codes(bench.ask(DriveBy(1, distance_m=goal, seq=7))) == []
    end = bench.until_end(60.0)
    assert (end.outcome, end.seq, end.fence) == ("done", 7, 1)
    assert end.distance_m == pytest.approx(goal, abs=0.02)
    assert end.distance_m == pytest.approx(bench.x, abs=0.001)
    assert bench.last == STILL
    assert bench.shown is None


@pytest.mark.parametrize("goal", [math.pi / 2, -math.pi / 2, math.tau, -0.1])
def test_an_angle_is_turned_and_measured(bench, goal):
    bench.ask(DriveBy(1, angle_rad=goal))
    end = bench.until_end(60.0)
    assert end.outcome == "done"
    assert end.angle_rad == pytest.approx(goal, abs=0.03)
    assert bench.x == 0.0


def test_no_velocity_exceeds_the_speed_and_each_passes_the_gate(bench):
    seen = []

    def half(asked):
        seen.append(asked)
        return Verdict(asked.scaled(0.5), asked, "obstacle", "slowed")

    bench.gate.says = half
    bench.ask(METRE)
    bench.until_end()
    assert max(asked.vx for asked in seen) <= 0.5
    assert max(sent.vx for sent in bench.base.sent) <= 0.25
    assert {(sent.vy, sent.w) for sent in bench.base.sent} == {(0.0, 0.0)}


def test_without_a_speed_it_drives_with_a_part_of_the_limit(bench):
    bench.ask(DriveBy(1, distance_m=2.0))
    bench.until_end()
    assert max(sent.vx for sent in bench.base.sent) == pytest.approx(0.4)


def test_the_operators_share_limits_the_speed_during_a_drive(bench):
    bench.max_share = 0.3
    bench.renew()
    [refusal] = bench.ask(METRE)
    assert (refusal.code, refusal.figures) == ("too_fast", {"limit_mps": 0.3})
    [refusal] = bench.ask(LEFT)
    assert (refusal.code, refusal.figures) == ("too_fast", {"limit_radps": 0.6})
    bench.begins(msgspec.structs.replace(METRE, distance_m=4.0, speed_mps=0.3))
    assert bench.last.vx == pytest.approx(0.3)
    bench.max_share = 0.1
    bench.renew()
    bench.step()
    assert bench.last.vx == pytest.approx(0.1)


def test_backwards_the_reverse_limit_counts(bench):
    [refusal] = bench.ask(DriveBy(1, distance_m=-1.0, speed_mps=0.5))
    assert refusal.figures == {"limit_mps": 0.2}


# --- records and answers ----------------------------------------------------------------------------


def test_it_moves_and_is_answered_after_its_record(bench):
    bench.sink.open.clear()
    answers = bench.ask(METRE)
    bench.step()
    assert (bench.last, answers, bench.shown) == (STILL, [], None)
    bench.sink.open.set()
    settled(bench)
    bench.step()
    bench.step()
    assert (answers, bench.shown.goal_m, bench.shown.who) == ([None], 1.0, "Ann")
    bench.until_end()
    bench.recorded()
    asked, end = bench.driven_by
    assert asked == {"distance_m": 1.0, "speed_mps": 0.5}
    assert end.outcome == "done"
    assert end.distance_m == pytest.approx(1.0, abs=0.02)
    for _ in range(20):
        bench.step()
    assert [kind for kind in bench.sink.kinds if kind.startswith("drive.")] == [
        "drive.by",
        "drive.start",
        "drive.by",
        "drive.end",
    ]


def test_it_does_not_move_without_a_record(bench):
    bench.sink.fails = "disk full"
    answers = bench.ask(METRE)
    settled(bench)
    bench.step()
    assert codes(answers) == ["not_recorded"]
    assert set(bench.base.sent) == {STILL}


def test_it_stops_when_records_cannot_be_written(bench):
    bench.begins(msgspec.structs.replace(METRE, distance_m=5.0))
    bench.sink.open.clear()
    bench.core._records.keep(lambda: None, bench.now_s)
    end = bench.until_end(5.0)
    bench.sink.open.set()
    assert end.outcome == "not_recorded"
    assert bench.last == STILL


def test_a_second_one_is_refused(bench):
    bench.begins()
    assert codes(bench.ask(LEFT)) == ["driving"]


def test_a_moving_robot_is_refused(bench):
    bench.core.odometry(bench.stamp_s + 0.01, bench.now_s, Pose(0.1, 0, 0), Velocity(0.3, 0, 0), 0.0)
    assert codes(bench.ask(METRE)) == ["base_moving"]


def test_a_motion_is_refused_until_it_ends(bench):
    bench.base.sweeps = {"wave": ()}
    bench.begins(seconds=0.3)
    while bench.shown:
        assert codes(bench.ask(wire.Play(1, "wave"))) == ["base_moving"]
        bench.step()
    answers = bench.ask(wire.Play(1, "wave"))
    bench.step()
    bench.step()
    assert answers == [None]


def test_it_is_refused_during_a_motion(bench):
    bench.base.sweeps = {"wave": ()}
    bench.ask(wire.Play(1, "wave"))
    assert codes(bench.ask(METRE)) == ["motion_running"]


@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"distance_m": 1.0, "angle_rad": 1.0},
        {"distance_m": 5.01},
        {"angle_rad": -6.4},
        {"distance_m": 1.0, "speed_radps": 1.0},
        {"angle_rad": 1.0, "speed_mps": 0.5},
        {"distance_m": 1.0, "speed_mps": 0.0},
        {"distance_m": 1.0, "speed_mps": -0.5},
        {"distance_m": "far"},
    ],
)
def test_no_door_takes_what_is_not_one_goal_within_its_bounds(fields):
    raw = json.dumps({"t": "drive_by", "fence": 1, "seq": 3} | fields)
    for door in (wire.browser_message, wire.link_request):
        with pytest.raises(wire.WireError) as caught:
            door(raw)
        assert caught.value.refusal.code == "invalid"


# --- other ends -------------------------------------------------------------------------------------


def loses_odometry(bench):
    bench.gate.misses = Fault("odometry_stale", "no odometry for 0.2 s", "odometry")


def loses_a_scan(bench):
    bench.gate.misses = Fault("scan_stale", "no scan for 0.5 s", "laser")


@pytest.mark.parametrize(
    ("happens", "outcome", "because"),
    [
        (lambda bench: bench.core.stop("Bob", "", bench.now_s), "stopped", "stopped"),
        (lambda bench: bench.core.revoke(1, "The slot ended.", bench.now_s), "control_lost", "control_ended"),
        (lambda bench: bench.core.link_lost(1, bench.now_s), "control_lost", "link_lost"),
        (lambda bench: bench.core.pause(1, "gone", 1, bench.now_s), "control_lost", "page_gone"),
        (lambda bench: bench.granted(fence=2), "control_lost", "control_ended"),
        (lambda bench: bench.granted(link=2), "control_lost", "page_back"),
        (
            lambda bench: bench.core.ros_status(RosStatus("waiting", ""), bench.now_s),
            "robot_offline",
            "robot_offline",
        ),
        (lambda bench: bench.core.close(bench.now_s), "bridge_ended", None),
    ],
)
def test_what_ends_control_or_halts_the_robot_ends_it_at_once(bench, happens, outcome, because):
    bench.begins()
    count = len(bench.base.sent)
    happens(bench)
    assert (bench.ended.outcome, bench.ended.because) == (outcome, because)
    assert bench.ended.distance_m > 0.1
    assert set(bench.base.sent[count:]) <= {STILL}
    if outcome != "bridge_ended":
        assert bench.last == STILL
        bench.step()
        assert bench.last == STILL
        bench.recorded()
    assert bench.shown is None


@pytest.mark.parametrize(
    ("happens", "outcome", "because"),
    [
        (loses_odometry, "no_odometry", "odometry_stale"),
        (loses_a_scan, "held_back", "scan_stale"),
    ],
)
def test_a_silent_sensor_ends_the_drive_for_good(bench, happens, outcome, because):
    bench.begins()
    happens(bench)
    bench.step()
    assert (bench.ended.outcome, bench.ended.because, bench.last) == (outcome, because, STILL)
    bench.gate.misses = None
    for _ in range(20):
        bench.step()
        assert bench.last == STILL


def test_a_refused_reverse_ends_it_and_the_next_drive_may_go(bench):
    bench.begins(DriveBy(1, distance_m=-1.0, speed_mps=0.1, seq=7))
    bench.gate.says = lambda asked: Verdict(STILL, asked, "behind_unseen", "stopped: nobody", neutral=True)
    bench.step()
    assert (bench.ended.outcome, bench.ended.because) == ("held_back", "behind_unseen")
    bench.gate.says = None
    bench.step()
    bench.step()
    bench.begins(DriveBy(1, distance_m=-1.0, speed_mps=0.1, seq=8))


def test_frozen_odometry_ends_it(bench):
    bench.begins()
    for _ in range(30):
        bench.now_s += 0.05
        bench.frozen_odometry()
        bench.core.tick(bench.now_s)
    assert bench.ended.outcome == "robot_offline"
    assert bench.last == STILL


def test_a_gate_that_holds_the_robot_ends_the_drive_with_reason(bench):
    bench.begins()
    bench.gate.says = lambda asked: Verdict(STILL, asked, "obstacle", "stopped: laser, 0.10 m ahead")
    began_s = bench.now_s
    end = bench.until_end()
    assert (end.outcome, end.because) == ("held_back", "obstacle")
    assert end.text == "Stopped: laser, 0.10 m ahead."
    assert bench.now_s - began_s == pytest.approx(HELD_S, abs=0.2)
    bench.gate.says = None
    bench.step()
    assert bench.last == STILL


def test_a_short_pause_of_the_gate_does_not_end_it(bench):
    bench.begins()
    bench.gate.says = lambda asked: Verdict(STILL, asked, "mover", "stopped: laser")
    for _ in range(40):
        bench.step()
    assert bench.ended is None
    bench.gate.says = None
    assert bench.until_end().outcome == "done"


def test_a_robot_that_does_not_obey_ends_it(bench):
    bench.obeys = False
    bench.ask(METRE)
    end = bench.until_end()
    assert (end.outcome, end.because) == ("no_progress", None)


def test_the_stick_takes_over_at_once(bench):
    bench.begins()
    assert bench.stick(-0.5) is None
    assert bench.ended.outcome == "replaced"
    assert bench.last.vx < 0.0
    bench.stick(0.0)
    for _ in range(10):
        bench.step()
    assert bench.last == STILL


def test_a_stick_in_the_middle_does_not(bench):
    bench.begins()
    assert bench.stick(0.0) is None
    assert bench.last.vx > 0.0
    assert bench.until_end().outcome == "done"


def test_a_published_velocity_takes_over_too(bench):
    bench.begins()
    fields = {"linear.x": 0.2}
    order = wire.Publish(
        1, "/key_vel", "geometry_msgs/Twist", fields, sent_ms=bench.now_s * 1000, seq=bench.seq + 1
    )
    bench.ask(order)
    assert bench.ended.outcome == "replaced"


def test_its_holder_may_cancel_it(bench):
    bench.begins()
    assert bench.ask(DriveByCancel(1)) == [None]
    assert bench.ended.outcome == "cancelled"
    bench.step()
    assert bench.last == STILL
    assert codes(bench.ask(DriveByCancel(1))) == ["no_drive"]


def test_a_console_that_no_longer_renews_control_ends_it(bench):
    bench.begins(msgspec.structs.replace(METRE, distance_m=5.0), 0.2)
    bench.renews_s = math.inf
    end = bench.until_end(CONFIRMED_S + 0.2)
    assert end.outcome == "control_lost"
    assert end.text == "Nothing came from the holder’s page or program for 2 s."


def test_a_page_that_the_console_does_not_hear_ends_it(bench):
    bench.begins(msgspec.structs.replace(METRE, distance_m=5.0), 0.2)
    bench.silent_since_s = bench.now_s
    end = bench.until_end(CONFIRMED_S + 0.2)
    assert end.outcome == "control_lost"
    assert bench.core.lease.current is not None


def test_it_does_not_begin_for_a_page_that_is_not_heard(bench):
    bench.silent_since_s = bench.now_s - CONFIRMED_S
    bench.renew()
    bench.ask(METRE)
    assert bench.until_end().outcome == "control_lost"
    assert set(bench.base.sent) == {STILL}


def test_a_bridge_that_was_late_ends_it(bench):
    bench.begins()
    bench.now_s += 0.5
    bench.odometry()
    bench.core.tick(bench.now_s, late_s=0.5)
    assert bench.ended.outcome == "late"
    assert bench.last == STILL


def test_a_command_of_another_fence_changes_nothing(bench):
    bench.begins()
    assert bench.stick(1.0, fence=9).code == "unknown_fence"
    assert codes(bench.ask(DriveByCancel(9))) == ["unknown_fence"]
    assert bench.until_end().outcome == "done"


@pytest.mark.parametrize(
    "happens",
    [
        lambda bench: bench.core.pause(1, "the page was left", 1, bench.now_s),
        lambda bench: bench.core.link_lost(1, bench.now_s),
        lambda bench: bench.granted(link=2),
        lambda bench: bench.granted(fence=2),
        lambda bench: bench.core.revoke(1, "over", bench.now_s),
        lambda bench: bench.core.stop("Bob", "", bench.now_s),
    ],
)
def test_a_drive_waiting_for_its_record_needs_control_to_begin(bench, happens):
    bench.sink.open.clear()
    answers = bench.ask(METRE)
    happens(bench)
    bench.sink.open.set()
    settled(bench)
    bench.step()
    assert len(answers) == 1 and answers[0] is not None
    assert set(bench.base.sent) <= {STILL}
    bench.recorded()
    assert [getattr(record, "outcome", "") for record in bench.driven_by][1:] != []
