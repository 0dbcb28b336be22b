"""A gap in the odometry: the gate keeps what it knew, and keeps away from it by what the robot may have moved."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.bridge.gate.timing.unseen_motion import UnseenMotion
from robots.bridge.gate.values import STILL, Limits, Pose, Velocity
from tests.gate.conftest import LASER, SONARS, Feeder, tiago_profile
from tests.gate.world import World, leg

LIMITS = Limits(1.0, 0.2, 0.0, 2.0, 1.0, 2.0)
BRAKING = 0.65, 1.3


def doubt(gap_s, before, after=STILL, commands=()):
    """The doubt after a gap; `commands`: pairs of a time after its beginning, and the twist sent from then on."""
    motion = UnseenMotion(LIMITS, BRAKING)
    early = [command for command in commands if command[0] <= 0.0]
    for at_s, twist in early:
        motion.sent(twist, 100.0 + at_s)
    motion.moved(before, 100.0)
    for at_s, twist in commands[len(early) :]:
        motion.sent(twist, 100.0 + at_s)
    return motion.doubt(after, 100.0 + gap_s, gap_s)


FORWARD, TURN = Velocity(0.5, 0.0, 0.0), Velocity(0.0, 0.0, 1.0)


@pytest.mark.parametrize(
    ("gap_s", "before", "after", "commands", "metres", "radians"),
    [
        # speed times gap
        (0.4, FORWARD, FORWARD, [(-1.0, FORWARD)], 0.2, 0.0),
        (0.4, TURN, TURN, [(-1.0, TURN)], 0.0, 0.4),
        # the command was faster than the base yet
        (0.4, STILL, STILL, [(-1.0, STILL), (-0.1, FORWARD)], 0.2, 0.0),
        # ... or became slower only in the gap
        (0.4, STILL, STILL, [(-1.0, FORWARD), (0.2, STILL)], 0.2, 0.0),
        # after the last command it brakes, and then stands: 0.5 m/s for 0.2 + 0.8 + 0.5/0.65 s
        (30.0, FORWARD, STILL, [(-1.0, FORWARD), (0.2, STILL)], 0.885, 0.0),
        # others drive it: it may be faster in between
        (1.0, FORWARD, FORWARD, [(-1.0, STILL)], 1.0, 0.0),
        (0.4, FORWARD, FORWARD, [(-9.0, STILL)], 0.4 * 0.7, 0.0),
        (5.0, STILL, FORWARD, [(-9.0, STILL)], 5.0, 0.0),
        # it stood
        (0.4, STILL, STILL, [(-9.0, STILL)], 0.0, 0.0),
        (5.0, STILL, STILL, [], 0.0, 0.0),
    ],
)
def test_the_doubt_is_speed_times_gap(gap_s, before, after, commands, metres, radians):
    crept = min(0.01 * gap_s, 0.1)
    found = doubt(gap_s, before, after, commands)
    assert metres - 1e-9 <= found.metres <= metres + crept + 0.001
    assert radians - 1e-9 <= found.radians <= radians + crept + 0.001


def behind_right(feeder: Feeder) -> float:
    """Distance from the robot's middle to the nearest remembered point behind it."""
    obstacles = feeder.gate.obstacles(feeder.now_s)
    remembered = [kind in ("memory", "depth memory") for kind in obstacles.kinds]
    points = obstacles.points[np.array(remembered)[obstacles.source]]
    return float(np.hypot(*points.T).min())


@pytest.fixture
def haunted() -> Feeder:
    """A TIAGo that remembers a wall 0.8 m from its middle, out of its laser's view."""
    feeder = Feeder(tiago_profile())
    feeder.ranges[5:130] = 0.6
    for yaw in (-30.0, 0.0, 30.0):
        feeder.pose = Pose(0.0, 0.0, math.radians(yaw))
        for _ in range(10):
            feeder.now_s += 0.05
            feeder.all()
        feeder.ranges = np.full(571, math.inf)
    return feeder


def silence(feeder: Feeder, gap_s: float, moves: Velocity = STILL) -> None:
    """A robot that drives (`moves` is commanded and measured), and no odometry for `gap_s`. Scans continue."""
    feeder.velocity = moves
    feeder.now_s += 0.05
    feeder.odometry()
    for _ in range(round(gap_s / 0.05)):
        feeder.now_s += 0.05
        feeder.scan()
        feeder.gate.decide(moves, moves, feeder.now_s)
    feeder.gate.observe_odometry(feeder.stamp_s, feeder.now_s, feeder.pose, moves)
    feeder._previous = feeder.now_s, feeder.pose
    feeder.now_s += 0.02
    feeder.all()


@pytest.mark.parametrize(
    ("moves", "grown_m"),
    [
        (STILL, 0.004),
        (Velocity(0.2, 0.0, 0.0), 0.08),
        (Velocity(0.0, 0.0, 0.3), 0.06),  # a turn moves far places farther: 0.12 rad at 0.5 m
    ],
)
def test_memory_comes_nearer_by_the_possible_motion(haunted, moves, grown_m):
    before_m = behind_right(haunted)
    silence(haunted, 0.4, moves)
    once_m = behind_right(haunted)
    assert grown_m - 0.01 < before_m - once_m < 1.5 * grown_m + 0.02
    silence(haunted, 0.4, moves)
    assert before_m - behind_right(haunted) > 1.8 * grown_m - 0.02, "gaps add up"
    assert haunted.gate.forgotten is None


def test_what_is_seen_again_is_certain_again(haunted):
    before = haunted.gate._memories[LASER]._memory
    silence(haunted, 0.4, Velocity(0.2, 0.0, 0.0))
    assert before.doubts_m().min() > 0.08
    haunted.velocity = STILL
    haunted.pose = Pose(0.0, 0.0, math.radians(-30))
    haunted.ranges[5:130] = 0.6
    for _ in range(10):
        haunted.now_s += 0.05
        haunted.all()
    assert np.mean(before.doubts_m() == 0.0) > 0.9


class Interrupted(World):
    """A robot whose odometry falls silent; `loses` the motion in the gap, as a driver that hung does."""

    silent = False
    loses = False
    lost = Pose(0.0, 0.0, 0.0)

    def _sense(self):
        observe, gate = self.gate.observe_odometry, self.gate
        if self.silent:
            gate.observe_odometry = lambda *_: None
        try:
            super()._sense()
        finally:
            gate.observe_odometry = observe

    def _move(self):
        before = self.pose
        super()._move()
        if self.silent and self.loses:
            self.lost = Pose(
                self.lost.x + self.pose.x - before.x,
                self.lost.y + self.pose.y - before.y,
                self.lost.yaw + self.pose.yaw - before.yaw,
            )

    @property
    def odometry(self):
        return Pose(self.pose.x - self.lost.x, self.pose.y - self.lost.y, self.pose.yaw - self.lost.yaw)


@pytest.mark.parametrize("loses", [False, True])
@pytest.mark.parametrize("gaps", [[0.38], [0.25, 0.25, 0.25], [5.0]])
@pytest.mark.parametrize("y", [0.0, 0.09])
def test_a_leg_behind_is_not_touched_after_gaps(y, gaps, loses):
    world = Interrupted(tiago_profile(), leg(-0.75, y, 0.03), sonar_cone=math.radians(20))
    world.loses = loses
    reverse = Velocity(-0.2, 0.0, 0.0)
    world.drive(STILL, 2.0)
    world.drive(reverse, 1.0)
    for gap_s in gaps:
        world.silent = True
        world.drive(reverse, gap_s)
        world.silent = False
        world.drive(STILL, 0.5)
        world.drive(reverse, 0.6)
    world.drive(reverse, 6.0)
    assert world.least_gap_m > 0.0
    assert world.gate.forgotten is None


def test_sonars_clear_nothing_while_odometry_is_silent():
    """The base may still roll: a leg that leaves a cone is not gone."""
    gate = Feeder(tiago_profile())
    gate.sonar_m = 0.3
    for _ in range(8):
        gate.now_s += 0.1
        gate.all()
    known = len(gate.gate._echoes.all_places())
    gate.sonar_m = math.inf
    gate.now_s += 0.25
    for _ in range(20):
        gate.now_s += 0.1
        gate.sonars()
    assert len(gate.gate._echoes.all_places()) == known
    for _ in range(8):  # the odometry shows that it stood
        gate.now_s += 0.1
        gate.gate.observe_odometry(gate.stamp_s, gate.now_s, gate.pose, STILL)
        gate.sonars()
    assert len(gate.gate._echoes.all_places()) < known


def test_a_free_place_frees_nothing_at_the_edge_of_the_view():
    """After a gap the obstacle may be beside its remembered place, where the sonar does not listen."""
    feeder = Feeder(tiago_profile(sonar_poses={"one": SONARS["base_sonar_02_link"]}, sonar_fov={"one": 0.5}))

    def heard(range_m, times=8):
        for _ in range(times):
            feeder.now_s += 0.1
            feeder.odometry()
            feeder.gate.observe_range("one", feeder.stamp_s, feeder.now_s, range_m, 1.0)

    heard(0.5)
    feeder.velocity = Velocity(0.0, 0.0, 0.5)
    for step in range(1, 5):
        feeder.now_s += 0.02
        feeder.pose = Pose(0.0, 0.0, 0.01 * step)
        feeder.odometry()
    feeder.now_s += 0.3
    feeder._previous = None
    feeder.velocity = STILL
    heard(math.inf, 20)
    assert len(feeder.gate._echoes.all_places()) > 0, "it may have turned by 0.4 rad: most of its cone"
