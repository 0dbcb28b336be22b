"""The robot's delay, measured from commands and odometry."""

from __future__ import annotations

import re

import numpy as np
import pytest

from robots.bridge.gate.timing.latency import (
    ADDED_S,
    ENOUGH,
    FORGOTTEN_S,
    JITTER_S,
    LATELY_S,
    LEAST_S,
    LONGEST_S,
    MOST_BACKLOG_S,
    Latency,
)
from robots.shared.configuration.gate_profile import Limits
from robots.shared.geometry.poses import Velocity
from robots.shared.records.verdict import SpeedLimit

LIMITS = Limits(1.0, 0.2, 0.0, 2.0944, 1.0, 2.0944)
ASSUMED_S = 0.2
ODOMETRY_S, COMMAND_S = 0.02, 0.05


class Base:
    """A base that obeys commands late, within its accelerations. Its odometry is noisy."""

    def __init__(
        self, delay_s: float, *, share: float = 1.0, noise: float = 0.004, deaf: bool = False
    ) -> None:
        self.latency = Latency(LIMITS, ASSUMED_S)
        self.delay_s, self.share, self.noise, self.deaf = delay_s, share, noise, deaf
        self.reported = 1.0  # share of its speed that the odometry reports
        self.now_s = 50.0
        self.late: list[tuple[float, Velocity]] = []
        self.asked = self.speed = Velocity(0.0, 0.0, 0.0)
        self.random = np.random.default_rng(4)

    def drive(self, vx: float, w: float, seconds: float) -> None:
        for tick in range(round(seconds / 0.01)):
            self.now_s += 0.01
            if tick % round(COMMAND_S / 0.01) == 0:
                twist = Velocity(vx, 0.0, w)
                self.latency.sent(twist, self.now_s)
                self.late.append((self.now_s + self.delay_s, twist))
            while self.late and self.late[0][0] <= self.now_s:
                self.asked = self.late.pop(0)[1]
            if not self.deaf:
                self._obey(0.01)
            if tick % round(ODOMETRY_S / 0.01) == 0:
                seen = self.random.normal(0.0, self.noise, 2)
                reported = Velocity(self.reported * self.speed.vx + seen[0], 0.0, self.speed.w + seen[1])
                self.latency.moved(reported, self.now_s)

    def _obey(self, passed_s: float) -> None:
        most = (self.share * passed_s, self.share * 2.0944 * passed_s)
        vx = self.speed.vx + float(np.clip(self.asked.vx - self.speed.vx, -most[0], most[0]))
        w = self.speed.w + float(np.clip(self.asked.w - self.speed.w, -most[1], most[1]))
        self.speed = Velocity(vx, 0.0, w)

    def about(self) -> float:
        """Drive forwards and backwards."""
        for vx, w in (
            (0.5, 0.0),
            (0.0, 0.0),
            (0.3, 0.8),
            (0.3, -0.8),
            (0.0, 0.0),
            (0.8, 0.0),
            (0.4, 1.0),
            (0.0, 0.0),
        ):
            self.drive(vx, w, 1.5)
        return self.latency.in_force_s(self.now_s)


@pytest.mark.parametrize("delay_s", [0.0, 0.06, 0.15, 0.30, 0.50])
def test_a_robots_delay_is_found_within_two_odometry_periods(delay_s):
    base = Base(delay_s)
    found_s = base.about()
    assert base.latency.measured_s == pytest.approx(found_s, abs=0.01)
    assert max(delay_s, LEAST_S - ADDED_S) + ADDED_S - 0.011 <= found_s <= max(delay_s, 0.05) + ADDED_S + 0.04


def test_at_least_a_tenth_of_a_second_of_latency_counts():
    assert Base(0.0).about() >= 0.1


def test_until_enough_is_measured_the_assumed_latency_holds():
    base = Base(0.05)
    base.drive(0.5, 0.0, 1.5)
    assert base.latency.measured_s is None
    assert base.latency.in_force_s(base.now_s) == ASSUMED_S


def test_a_late_robot_counts_from_its_first_measurement():
    base = Base(0.40)
    base.drive(0.5, 0.0, 1.5)
    assert base.latency.measured_s is None
    assert base.latency.in_force_s(base.now_s) >= 0.40 + ADDED_S - 0.011


def test_an_unanswered_command_makes_the_wait_the_latency():
    base = Base(0.60)
    base.drive(0.5, 0.0, 0.5)
    # The wait counts from the second command, 0.06 s after the start: at the first, no odometry had arrived.
    assert base.latency.in_force_s(base.now_s) == pytest.approx(0.44, abs=0.06)


def test_a_restarted_robot_is_measured_again():
    base = Base(0.5)
    assert base.about() >= 0.5
    came(base.latency, [0.03] * 20 + [0.6] * 20)
    base.latency.forget()
    assert base.latency.measured_s is None
    assert base.latency.in_force_s(base.now_s) == ASSUMED_S


def ramp(base, seconds, step=0.05):
    """Send rising commands at the gate's limit; return the greatest worst-case latency."""
    vx, most_s = 0.0, 0.0
    for _ in range(round(seconds / COMMAND_S)):
        vx = min(vx + step, 1.0)
        base.drive(vx, 0.0, COMMAND_S)
        most_s = max(most_s, base.latency.worst_s(base.now_s))
    return most_s


@pytest.mark.parametrize("delay_s", [0.05, 0.15, 0.4, 0.6])
def test_before_the_first_answer_the_longest_delay_counts(delay_s):
    base = Base(delay_s)
    base.drive(0.0, 0.0, 1.0)
    assert base.latency.worst_s(base.now_s) == LONGEST_S
    assert base.latency.in_force_s(base.now_s) == ASSUMED_S, "only the assumed delay is reported"
    assert ramp(base, delay_s - 0.05 if delay_s > 0.05 else 0.0) in (0.0, LONGEST_S)
    ramp_began_s = base.now_s - max(delay_s - 0.05, 0.0)
    while base.latency.worst_s(base.now_s) == LONGEST_S:
        base.drive(0.5, 0.0, COMMAND_S)
    assert base.now_s - ramp_began_s < delay_s + 0.2, "an answer is enough"
    assert base.latency.worst_s(base.now_s) >= max(delay_s, ASSUMED_S)


def test_a_late_answer_counts_until_the_measurement_is_done():
    base = Base(0.48)
    base.drive(0.0, 0.0, 1.0)
    for _ in range(60):
        base.drive(1.0, 0.0, COMMAND_S)
        assert base.latency.worst_s(base.now_s) >= 0.48


def test_an_answer_to_a_possibly_older_command_does_not_count():
    base = Base(0.5)
    base.drive(0.0, 0.0, 1.0)
    for _ in range(8):  # tapped stick: the base reacts to the first tap during the second or third
        base.drive(0.3, 0.0, 0.1)
        base.drive(0.0, 0.0, 0.1)
        assert base.latency.worst_s(base.now_s) >= 0.5


def test_a_robot_that_stops_answering_counts_as_latest():
    base = Base(0.1)
    base.about()
    base.drive(0.8, 0.0, 2.0)
    known_s = base.latency.worst_s(base.now_s)
    assert known_s < 0.25
    base.delay_s = 0.6
    base.drive(0.3, 0.0, 0.2)
    assert base.latency.worst_s(base.now_s) < LONGEST_S
    base.drive(0.3, 0.0, 0.15)
    assert base.latency.worst_s(base.now_s) == LONGEST_S
    base.drive(0.3, 0.0, 0.4)
    assert base.latency.worst_s(base.now_s) >= 0.6 - 0.05


def test_a_base_that_leaves_its_commanded_speed_counts_as_latest():
    base = Base(0.1)
    base.about()
    base.drive(0.8, 0.0, 3.0)
    assert base.latency.worst_s(base.now_s) < 0.25
    base.late.append((base.now_s, Velocity(0.0, 0.0, 0.0)))  # its controller brakes without commands
    base.late += [(base.now_s + 0.2, Velocity(0.8, 0.0, 0.0))]
    base.delay_s = 0.5
    base.drive(0.8, 0.0, 0.2)
    assert base.latency.worst_s(base.now_s) == LONGEST_S
    base.drive(0.8, 0.0, LONGEST_S + 0.5)
    assert base.latency.worst_s(base.now_s) < 0.25


def test_a_bad_minutes_measurements_fade():
    base = Base(0.5)
    bad_s = base.about()
    base.drive(0.0, 0.0, 20.0)
    assert base.latency.in_force_s(base.now_s) == pytest.approx(bad_s, abs=0.02), "a slow robot stays slow"
    base.delay_s = 0.1
    base.about()
    better_s = base.about()
    assert better_s < bad_s - 0.1
    base.about()
    assert base.latency.in_force_s(base.now_s) < 0.25


def test_after_a_minute_of_rest_nothing_is_known_of_a_robot():
    base = Base(0.5)
    base.about()
    base.drive(0.0, 0.0, FORGOTTEN_S + 0.2)
    assert base.latency.measured_s is None
    assert base.latency.in_force_s(base.now_s) == ASSUMED_S
    assert base.latency.worst_s(base.now_s) == LONGEST_S


def test_a_robot_driven_by_others_is_not_measured():
    base = Base(0.1, deaf=True)
    for _ in range(2 * ENOUGH):
        base.drive(0.5, 0.0, 1.5)
        base.speed = Velocity(float(base.random.uniform(-0.5, 0.5)), 0.0, 0.0)
        base.drive(0.0, 0.0, 1.5)
    assert base.latency.measured_s is None


def test_weak_brakes_count_as_latency_and_not_as_nothing():
    assert Base(0.1, share=0.6).about() > Base(0.1).about()


def test_the_wait_counts_up_to_the_longest_known_delay():
    base = Base(0.1, deaf=True)
    base.drive(0.5, 0.0, 1.15)
    assert base.latency.in_force_s(base.now_s) == pytest.approx(LONGEST_S)


@pytest.mark.parametrize("delay_s", [0.05, 0.4])
def test_the_gate_uses_measured_latency_and_names_late_robots(tiago, delay_s):
    base = Base(delay_s)
    base.latency = tiago.gate.latency
    base.now_s = tiago.now_s
    for vx in (0.5, 0.0) * ENOUGH:
        base.drive(vx, 0.0, 1.5)
    tiago.now_s = base.now_s
    tiago.all()
    verdict = tiago.decide(1.0)
    if delay_s < ASSUMED_S:
        assert (verdict.code, verdict.limits) == ("free", ())
    else:
        assert verdict.code == "robot_late"
        assert re.fullmatch("at most 0.9 m/s: the robot answers after 0.4[56] s", verdict.text)
        assert verdict.limits == (SpeedLimit("robot_late", verdict.text, pytest.approx(verdict.velocity.vx)),)
    tiago.ahead_at(0.9)
    tiago.stay(5.0)
    assert tiago.decide(1.0).velocity.vx == pytest.approx({0.05: 0.85, 0.4: 0.67}[delay_s], abs=0.02)


def test_a_command_counts_from_its_decision(tiago):
    base, sent = Base(0.15), Velocity(0.0, 0.0, 0.0)
    base.latency = None
    now_s, late, speed = tiago.now_s, [], 0.0
    for tick in range(round(30.0 / 0.01)):
        now_s += 0.01
        tiago.now_s = now_s
        if tick % 5 == 0:
            asked = Velocity(0.5 if (tick // 150) % 2 else 0.0, 0.0, 0.0)
            tiago.scan()
            tiago.sonars()
            sent = tiago.gate.decide(asked, sent, now_s).velocity
            late.append((now_s + 0.15, sent.vx))
        while late and late[0][0] <= now_s:
            asked_vx = late.pop(0)[1]
        if tick > 20:
            speed += float(np.clip(asked_vx - speed, -0.01, 0.01))
        if tick % 2 == 0:
            tiago.velocity = Velocity(speed, 0.0, 0.0)
            tiago.odometry()
    assert 0.15 + ADDED_S - 0.02 <= tiago.gate.latency.measured_s <= 0.15 + ADDED_S + 0.03


def test_a_distant_operator_drives_slower_and_learns_why(tiago):
    for hardly_s in (0.25, 0.33):  # the second would be "at most 1.0 m/s", which the robot does anyway
        tiago.gate.observe_operator(hardly_s)
        assert (tiago.decide(1.0).code, tiago.decide(1.0).velocity.vx) == ("free", 1.0)
    tiago.gate.observe_operator(0.8)
    verdict = tiago.decide(1.0)
    assert (verdict.code, verdict.velocity.vx) == ("operator_late", pytest.approx(0.77, abs=0.01))
    assert verdict.text == "at most 0.8 m/s: the page answers after 0.80 s"


def test_who_drives_by_an_old_camera_picture_drives_slower(tiago):
    tiago.gate.observe_camera_view(0.3)
    assert tiago.decide(1.0).code == "free"
    tiago.gate.observe_camera_view(1.3)
    verdict = tiago.decide(1.0)
    assert verdict.code == "camera_late"
    assert verdict.velocity.vx < 0.7
    assert "the camera’s picture comes after 1.30 s" in verdict.text
    tiago.gate.observe_camera_view(None)
    assert tiago.decide(1.0).code == "free"


# --- growing delay of messages ------------------------------------------------------------------------


def came(latency, delays_s, begin_s=50.0, clock_s=3600.0, source="odometry", period_s=0.05):
    """Feed messages with these delays from a robot with a clock one hour ahead; return the last arrival time."""
    for number, delay_s in enumerate(delays_s):
        stamp_s = begin_s + number * period_s
        latency.arrived(source, stamp_s + clock_s, stamp_s + delay_s)
    return stamp_s + delay_s


def counted(*delays_s):
    latency = Latency(LIMITS, ASSUMED_S)
    return latency.in_force_s(came(latency, delays_s)) - ASSUMED_S


def test_growing_delays_count_both_ways_without_losses():
    growing = np.linspace(0.03, 0.53, 100)
    assert counted(*growing, *[0.53] * 20) == pytest.approx(2 * (0.5 - JITTER_S), abs=0.03)


def test_a_steady_delay_counts_as_none_and_so_does_one_late():
    assert counted(*[0.4] * 100) == 0.0
    assert counted(*[0.03] * 50, 0.3, *[0.03] * 5) == 0.0


def test_jitter_is_no_delay():
    jitter_s = np.random.default_rng(2).uniform(0.02, 0.10, 400)
    assert counted(*jitter_s) < 0.02


@pytest.mark.parametrize("ahead_s", [0.1, 0.5])
def test_one_stamp_ahead_of_time_makes_no_robot_late(ahead_s):
    latency = Latency(LIMITS, ASSUMED_S)
    now_s = came(latency, [0.03] * 50, source="laser")
    latency.arrived("laser", now_s + 3600.0 + ahead_s, now_s + 0.03)
    now_s = came(latency, [0.03] * 20, begin_s=now_s + ahead_s + 0.05, source="laser")
    assert latency.in_force_s(now_s) == ASSUMED_S


def test_silence_after_a_stamp_ahead_of_time_counts_at_once():
    latency = Latency(LIMITS, ASSUMED_S)
    now_s = came(latency, [0.03] * 100, period_s=0.02) + 0.02
    latency.arrived("odometry", now_s - 0.03 + 3600.0 + 0.5, now_s)
    assert latency.in_force_s(now_s + 0.1) == pytest.approx(ASSUMED_S + 0.042, abs=0.002)


def test_rare_quick_messages_count_as_the_best():
    latency = Latency(LIMITS, ASSUMED_S)
    came(latency, [*[0.10] * 9, 0.03] * 5)
    now_s = came(latency, [0.15] * 10, begin_s=52.5)
    assert latency.in_force_s(now_s) == pytest.approx(ASSUMED_S + 2 * (0.12 - JITTER_S), abs=0.01)


def test_a_lasting_delay_becomes_usual_a_short_one_ends():
    lasting = [0.03] * 20 + [0.13] * 1000
    assert counted(*lasting[:100]) > 0.1
    assert counted(*lasting) < 0.1
    assert counted(*lasting[:100], *[0.03] * 2) == 0.0


def test_each_millisecond_of_silence_counts_beyond_the_usual_gap():
    latency = Latency(LIMITS, ASSUMED_S)
    now_s = came(latency, [0.03] * 100, period_s=0.02)
    assert latency.in_force_s(now_s + 0.02 + JITTER_S) == pytest.approx(ASSUMED_S, abs=0.001)
    for silent_s, later_s in ((0.06, 0.02), (0.1, 0.06), (0.15, 0.16), (0.2, 0.26)):
        assumed_s = latency.in_force_s(now_s + silent_s)
        assert assumed_s == pytest.approx(ASSUMED_S + later_s, abs=0.001), "from 0.1 s on it counts both ways"


def test_suddenly_late_messages_count_from_the_first():
    latency = Latency(LIMITS, ASSUMED_S)
    came(latency, [0.03] * 100, period_s=0.02)
    now_s = came(latency, [0.13], begin_s=52.0, period_s=0.02)
    assert latency.in_force_s(now_s) == pytest.approx(ASSUMED_S + 0.1 - 0.02 - JITTER_S, abs=0.005)
    now_s = came(latency, [0.13] * round(LATELY_S / 0.02 + 1), begin_s=52.02, period_s=0.02)
    assert latency.in_force_s(now_s) == pytest.approx(ASSUMED_S + 2 * (0.1 - JITTER_S), abs=0.005)


def test_odometry_that_jitters_is_not_late():
    latency, random = Latency(LIMITS, ASSUMED_S), np.random.default_rng(3)
    assumed_s = []
    for number in range(3000):
        stamp_s = 50.0 + 0.02 * number
        came(latency, [0.02 + abs(random.normal(0.0, 0.004))], begin_s=stamp_s)
        assumed_s.append(latency.in_force_s(stamp_s + 0.04))
    assert np.mean(assumed_s) < ASSUMED_S + 0.002
    assert max(assumed_s) < ASSUMED_S + 0.03


def test_the_slowest_source_counts_for_at_most_a_second():
    latency = Latency(LIMITS, ASSUMED_S)
    came(latency, [0.03] * 100)
    now_s = came(latency, np.linspace(0.03, 4.0, 100), source="laser")
    assert latency.in_force_s(now_s) == ASSUMED_S + 2 * MOST_BACKLOG_S


@pytest.mark.parametrize("set_by_s", [3600.0, -3600.0])
def test_a_clock_that_is_set_is_no_delay(set_by_s):
    latency = Latency(LIMITS, ASSUMED_S)
    came(latency, [0.03] * 50)
    now_s = came(latency, [0.03] * 50, begin_s=52.5, clock_s=3600.0 + set_by_s)
    assert latency.in_force_s(now_s) == ASSUMED_S


@pytest.mark.parametrize("source", ["odometry", "scan"])
def test_the_gate_hears_of_messages_that_come_later_and_says_so(tiago, source):
    for number in range(60):
        tiago.now_s += 0.05
        later_s = min(0.01 * number, 0.15)
        for kind in ("odometry", "scan"):
            tiago.clock_offset_s = -later_s if kind == source else 0.0
            getattr(tiago, kind)()
    verdict = tiago.decide(1.0)
    assert verdict.code == "robot_late"
    assert "the robot answers after 0.4" in verdict.text
    assert 0.8 < verdict.velocity.vx < 0.9


# --- growing delay of commands ------------------------------------------------------------------------


def answered(latency, *took_s, begin_s=50.0):
    """Acknowledge one twist each period, after these times; return the latency minus the assumed latency."""
    for number, one_s in enumerate(took_s):
        latency.acknowledged(one_s, begin_s + 0.05 * number)
    return latency.in_force_s(begin_s + 0.05 * len(took_s)) - ASSUMED_S


def test_growing_acknowledgement_delays_count_once():
    latency = Latency(LIMITS, ASSUMED_S)
    assert answered(latency, *[0.05] * 40) == 0.0
    assert answered(latency, *[0.45] * 20, begin_s=52.0) == pytest.approx(0.4 - JITTER_S, abs=0.01)


def test_a_link_whose_both_ways_grow_slow_is_not_counted_twice():
    latency = Latency(LIMITS, ASSUMED_S)
    came(latency, [0.03] * 40 + [0.23] * 20)
    assert answered(latency, *[0.05] * 40, *[0.45] * 20) == pytest.approx(2 * (0.2 - JITTER_S), abs=0.03)


def test_single_late_acknowledgements_are_no_delay():
    assert answered(Latency(LIMITS, ASSUMED_S), *[0.0, 0.04, 0.3, 0.0, 0.15] * 20) == 0.0


def test_the_gate_says_so_while_the_sensors_are_in_time(tiago):
    for number in range(60):
        tiago.now_s += 0.05
        tiago.gate.observe_acknowledgement(0.01 if number < 30 else 0.31, tiago.now_s)
        tiago.odometry()
        tiago.scan()
    verdict = tiago.decide(1.0)
    assert verdict.code == "robot_late"
    assert "the robot answers after 0.48 s" in verdict.text
    tiago.gate.observe_acknowledgement(float("nan"), tiago.now_s)
    assert tiago.decide(1.0).code == "robot_late"


def test_a_base_that_brakes_by_itself_may_get_its_commands_late():
    """If commands suddenly come 0.4 s later, none comes for a time, and the base's own dead-man brakes."""
    base = Base(0.1)
    base.about()
    base.drive(0.5, 0.0, 2.0)
    known_s = base.latency.worst_s(base.now_s)
    assert known_s < 0.3
    base.asked, base.late = Velocity(0.0, 0.0, 0.0), []
    base.delay_s = 0.5
    base.drive(0.45, 0.0, 0.25)
    assert base.speed.vx < 0.4
    assert base.latency.worst_s(base.now_s) >= LONGEST_S


def test_a_base_that_is_always_slower_is_not_taken_for_late():
    base = Base(0.1)
    base.about()
    base.reported = 0.9
    base.drive(1.0, 0.0, 3.0)
    for _ in range(20):
        base.drive(1.0, 0.0, 0.1)
        assert base.latency.worst_s(base.now_s) < LONGEST_S


# --- clocks of another pace ---------------------------------------------------------------------------


@pytest.mark.parametrize("pace", [0.3, 0.7, 1.5])
def test_a_simulated_clock_of_another_pace_is_no_lateness(pace):
    latency = Latency(LIMITS, ASSUMED_S)
    latency.follow_clock(simulated=True)
    for number in range(1000):
        now_s = 50.0 + number * 0.02
        latency.arrived("odometry", 7.0 + pace * now_s, now_s)
        latency.arrived("laser", 7.0 + pace * now_s, now_s)
        assert latency.in_force_s(now_s) == ASSUMED_S
    assert latency.lateness_s(now_s + 0.5) > 0.4, "silence counts"


def test_a_simulated_clock_that_pauses_or_begins_again_is_no_lateness():
    latency = Latency(LIMITS, ASSUMED_S)
    latency.follow_clock(simulated=True)
    for begin_s, stamp_s in ((50.0, 1000.0), (80.0, 1004.0), (90.0, 3.0)):
        for number in range(200):
            latency.arrived("odometry", stamp_s + number * 0.02, begin_s + number * 0.02)
        assert latency.in_force_s(begin_s + 199 * 0.02) == ASSUMED_S


def test_without_a_simulated_clock_stamps_that_fall_behind_count():
    latency = Latency(LIMITS, ASSUMED_S)
    for number in range(200):
        latency.arrived("odometry", 0.7 * number * 0.02, number * 0.02)
    assert latency.lateness_s(199 * 0.02) == pytest.approx(2.0, abs=0.4)


@pytest.mark.parametrize(("pace", "named"), [(0.3, 0.3), (0.7, 0.7), (0.97, None), (1.0, None), (1.5, None)])
def test_a_slow_clock_is_named_with_its_pace(pace, named):
    latency = Latency(LIMITS, ASSUMED_S)
    for number in range(1100):
        latency.arrived("odometry", 7.0 + pace * number * 0.02, number * 0.02)
    assert latency.slow_clock == (pytest.approx(named) if named else None)
    for number in range(1100, 2200):  # the clock was set back, and is right now
        latency.arrived("odometry", 1.0 + number * 0.02, number * 0.02)
    assert latency.slow_clock is None


def test_the_limit_of_a_robot_with_a_slow_clock_says_why(tiago):
    for number in range(440):
        tiago.now_s += 0.05
        tiago.clock_offset_s = -0.3 * 0.05 * number
        tiago.odometry()
    tiago.all()
    text = tiago.decide(1.0).text
    assert "by its clock, which runs at 0.70 of our pace (simulated? set use_sim_time)" in text
