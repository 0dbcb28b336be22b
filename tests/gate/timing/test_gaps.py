"""A gap in the odometry, or stamps that go back a little: the gate keeps what it knew.

After a gap it keeps away from it by what the robot may have moved.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.bridge.gate.timing.unseen_motion import UnseenMotion
from robots.shared.configuration.gate_profile import Limits
from robots.shared.geometry.poses import STILL, Pose, Velocity
from tests.gate.conftest import LASER, SONARS, Feeder, tiago_profile
from tests.gate.world import World, leg, wall

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
    feeder.previous = feeder.now_s, feeder.pose
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
    before = haunted.laser_memory
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

    def sense(self):
        observe, gate = self.gate.observe_odometry, self.gate
        if self.silent:
            gate.observe_odometry = lambda *_: None
        try:
            super().sense()
        finally:
            gate.observe_odometry = observe

    def move(self):
        before = self.pose
        super().move()
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
    known = gate.sonar_places
    gate.sonar_m = math.inf
    gate.now_s += 0.25
    for _ in range(20):
        gate.now_s += 0.1
        gate.sonars()
    assert gate.sonar_places == known
    for _ in range(8):  # the odometry shows that it stood
        gate.now_s += 0.1
        gate.gate.observe_odometry(gate.stamp_s, gate.now_s, gate.pose, STILL)
        gate.sonars()
    assert gate.sonar_places < known


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
    feeder.previous = None
    feeder.velocity = STILL
    heard(math.inf, 20)
    assert feeder.sonar_places > 0, "it may have turned by 0.4 rad: most of its cone"


def set_back(by_s):
    """Errors of stamps: from the 10th message on, a time server has set the clock back."""
    return [0.0] * 10 + [-by_s] * 25


def one_ahead(by_s):
    return [0.0] * 10 + [by_s] + [0.0] * 25


def jitter(sigma_s, seed):
    return np.random.default_rng(seed).normal(0.0, sigma_s, 35).tolist()


def listen(feeder, period_s, errors_s, moves=STILL):
    """Feed odometry and scans whose stamps have these errors, from a robot that moves straight ahead."""
    feeder.velocity = moves
    for number, error_s in enumerate(errors_s):
        feeder.now_s += period_s
        feeder.pose = feeder.pose._replace(x=feeder.pose.x + period_s * moves.vx)
        feeder.gate.observe_odometry(feeder.now_s + error_s, feeder.now_s, feeder.pose, moves)
        if number % 5 == 0:
            feeder.scan(stamp_s=feeder.now_s + error_s)


@pytest.mark.parametrize("moves", [STILL, Velocity(0.3, 0.0, 0.0)], ids=["stands", "drives"])
@pytest.mark.parametrize(
    ("period_s", "errors_s"),
    [
        pytest.param(0.01, set_back(0.05), id="100 Hz, set back by 0.05 s"),
        pytest.param(0.02, set_back(0.08), id="50 Hz, set back by 0.08 s"),
        pytest.param(0.02, set_back(0.95), id="50 Hz, set back by 0.95 s"),
        pytest.param(0.02, one_ahead(0.085), id="50 Hz, one ahead by 0.085 s"),
        pytest.param(0.02, one_ahead(0.5), id="50 Hz, one ahead by 0.5 s"),
        *(pytest.param(0.01, jitter(0.02, seed), id=f"100 Hz, jitter {seed}") for seed in range(3)),
        pytest.param(0.02, jitter(0.06, 3), id="50 Hz, large jitter"),
    ],
)
def test_stamps_that_go_back_a_little_forget_nothing(haunted, period_s, errors_s, moves):
    haunted.pose = Pose(0.0, 0.0, 0.0)
    listen(haunted, period_s, [0.0] * 5)
    memory = haunted.laser_memory
    kept = len(memory.points(haunted.now_s))
    listen(haunted, period_s, errors_s, moves)
    assert haunted.gate.forgotten is None and haunted.resets == 0
    assert len(memory.points(haunted.now_s)) == kept > 10
    haunted.decide()
    assert haunted.decide(0.1).code == "free"


def test_a_jump_while_stamps_go_back_is_a_jump(haunted):
    listen(haunted, 0.02, [0.0] * 5)
    haunted.pose = Pose(1.0, 0.0, 0.0)
    listen(haunted, 0.02, [-0.08] * 8)
    assert haunted.gate.forgotten.code == "jump"


def test_stamps_older_than_all_poses_are_another_frame(tiago):
    """The gate has listened for a tenth of a second: where the robot was at that stamp is unknown."""
    tiago.sonar_m = 0.5
    for _ in range(8):
        tiago.sonars()
        listen(tiago, 0.02, [0.0])
    listen(tiago, 0.02, [-0.9] * 3)
    assert tiago.resets == 1


ROOM = [*wall(6, -3, 6, 3), *wall(-2, 3, 6, 3), *wall(-2, -3, 6, -3), *wall(-2, -3, -2, 3)]
POSTS = [*leg(2.5, 1.0, 0.06), *leg(2.5, -1.2, 0.06), *leg(4.0, 1.5, 0.06), *leg(4.0, -0.8, 0.06)]


def test_furniture_stands_still_after_a_gap():
    """The odometry missed 0.12 m: walls and posts are in other places than before.

    With the noise of this seed a mover was followed for 1.6 s.
    """
    world = Interrupted(tiago_profile(), [*ROOM, *POSTS], seed=2)
    world.loses = True
    forward = Velocity(0.3, 0.0, 0.0)
    world.drive(forward, 2.0)
    world.silent = True
    world.drive(forward, 0.4)
    world.silent = False
    for _ in range(40):
        world.drive(forward, 0.05)
        assert not world.gate._movers[LASER].tracks
    assert world.lost.x > 0.1
