"""Somebody has control and the robot rests: sensors wait, and nothing that ends the rest is judged without them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from msgspec import structs

from robots.bridge.gate.gate import Gate
from robots.bridge.gate.timing.freshness import LASER_LATE_S
from robots.bridge.gate.values import LaserScan
from robots.shared import wire
from robots.shared.geometry.poses import STILL, Pose, Velocity
from tests.bridge.support import CONFIG, Bench, ObedientBench
from tests.gate.conftest import LASER, SONARS, tiago_profile


class Room(Bench):
    """A TIAGo with a real gate in a hall. Its sensors' messages wait for the event loop while it rests."""

    def __init__(self) -> None:
        profile = tiago_profile()
        self.ranges = np.full(571, math.inf)
        self.laser_works = True
        super().__init__(config=structs.replace(CONFIG, gate=profile), gate=Gate(profile))

    def odometry(self, speed: Velocity | None = None) -> None:
        self.speed = speed or self.speed
        self.stamp_s = self.now_s
        now_s, velocity, ranges = self.now_s, self.speed, self.ranges.copy()
        self.post(lambda: self.core.odometry(now_s, now_s, Pose(0.0, 0.0, 0.0), velocity, now_s))
        for name in SONARS:
            self.post(lambda name=name: self.core.range(name, now_s, now_s, math.inf))
        if self.laser_works:
            half = math.radians(95)
            scan = LaserScan(LASER, now_s, now_s, ranges, -half, half / 285, 0.05, 25.0)
            self.post(lambda: self.core.laser(scan))

    def post(self, call) -> None:
        self.base.waiting.append(call)
        if not self.core.rests:
            self.base.take_waiting()

    def pass_time(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.05)):
            self.now_s += 0.05
            self.base.take_waiting()
            self.odometry()
            self.core.tick(self.now_s)
            self.recorded()


@pytest.fixture
def room():
    room = Room().online()
    room.odometry()
    room.granted().pass_time(1.0)
    assert room.core.rests
    assert not room.core.needs_fresh_sensors
    yield room
    room.close()


def test_an_obstacle_from_the_rest_holds_the_first_command(room):
    room.now_s += 0.04
    room.ranges[260:310] = 0.15
    room.odometry()
    assert room.base.waiting, "its scan is not taken yet"
    room.stick(1.0)
    assert room.core.needs_fresh_sensors
    assert room.base.waiting, "no command waits for it: the begin of the drive is recorded first"
    room.recorded()
    room.now_s += 0.005
    room.stick(1.0)
    assert not room.base.waiting
    assert room.last == STILL
    assert room.core.verdict.code == "obstacle"


def test_the_same_command_drives_where_nothing_came(room):
    room.stick(1.0)
    room.recorded()
    room.core.recorded(room.now_s + 0.005)
    assert room.last.vx > 0.0


def test_what_waits_is_taken_while_the_begin_of_the_drive_is_recorded(room):
    room.now_s += 0.04
    room.odometry()
    assert not room.wakes
    room.stick(1.0)
    assert room.wakes == [room.now_s]
    room.core.catch_up()
    assert not room.base.waiting


@pytest.mark.parametrize("instantly", [False, True], ids=["later", "instantly"])
def test_the_gate_judges_no_motion_before_what_waits_is_taken(room, monkeypatch, instantly):
    order = []
    take, decide = room.base.take_waiting, room.core._gate.decide

    def judged(asked, sent, now_s):
        order.append("judged" if asked != STILL else "idle")
        return decide(asked, sent, now_s)

    monkeypatch.setattr(room.base, "take_waiting", lambda: (order.append("taken"), take()))
    monkeypatch.setattr(room.core._gate, "decide", judged)
    if instantly:
        monkeypatch.setattr(room.drives, "may_move", lambda *_: None)
    room.stick(1.0)
    room.recorded()
    room.core.recorded(room.now_s)
    assert order.index("taken") < order.index("judged")


def test_a_laser_that_dies_ends_the_rest_before_it_counts_as_stale(room):
    room.laser_works = False
    room.pass_time(LASER_LATE_S)
    assert room.core.rests
    room.pass_time(0.1)
    assert not room.core.rests
    room.pass_time(0.3)
    state = room.core.state(room.now_s, [])
    assert [sensor.name for sensor in state.sensors if not sensor.ok] == [LASER]
    room.stick(1.0)
    assert room.last == STILL
    assert room.core.state(room.now_s, []).neutral_needed.code == "scan_stale"


def test_odometry_that_ends_ends_the_rest_between_two_ticks(room):
    room.now_s += 0.15
    room.core.repeat_zero(room.now_s)
    assert room.core.rests
    room.now_s += 0.06
    room.core.repeat_zero(room.now_s)
    assert not room.core.rests


def test_odometry_that_waits_is_not_taken_for_silent(room):
    room.now_s += 0.15
    room.odometry()
    room.now_s += 0.06
    room.core.repeat_zero(room.now_s)
    assert room.core.rests


def test_a_robot_that_moves_by_itself_does_not_rest(room):
    room.speed = Velocity(0.1, 0.0, 0.0)
    room.pass_time(0.1)
    assert not room.core.rests


def test_a_stick_that_is_out_keeps_the_robot_awake(room):
    room.stick(0.5)
    room.recorded()
    for _ in range(4):
        room.pass_time(0.05)
        room.stick(0.5)
        assert not room.core.rests
    room.stick(0.0)
    room.pass_time(0.3)
    assert not room.core.rests, "its drive is under way"
    room.pass_time(0.6)
    assert room.core.rests


@pytest.mark.parametrize("end", ["stop", "lost page", "control"])
def test_what_ends_or_pauses_control_ends_the_rest(room, end):
    if end == "stop":
        room.core.stop("Ann", "", room.now_s)
    elif end == "lost page":
        room.core.link_lost(1, room.now_s)
    else:
        room.core.revoke(1, "enough", room.now_s)
    assert not room.core.rests
    assert room.wakes, "what waits is taken soon, after zero was sent"
    room.core.tick(room.now_s)
    assert room.core.rests == (end == "lost page")


def test_zeros_are_repeated_between_two_ticks(room):
    count = len(room.base.sent)
    room.core.repeat_zero(room.now_s + 0.05)
    assert room.base.sent[count:] == [STILL]


@pytest.mark.parametrize("order", [wire.Go(1, 3.0, 1.0, 0.5), wire.Play(1, "wave"), wire.DriveBy(1, 1.0)])
def test_a_task_begins_with_what_waited(order):
    bench = ObedientBench()
    bench.pass_time(0.2)
    assert bench.core.rests
    taken = []
    bench.base.waiting.append(lambda: taken.append(bench.now_s))
    bench.order(order)
    bench.recorded()
    bench.core.recorded(bench.now_s)
    assert taken
    bench.core.tick(bench.now_s)
    assert not bench.core.rests
    bench.close()
