"""Trajectories move the joints within their limits and speeds, and share controllers with motions."""

from __future__ import annotations

import math

import pytest

from robots.simulator.joints.joint_table import JOINTS
from robots.simulator.joints.motions import ErrorCode, Phase, Player, Point, RefusedError, load_motions
from robots.simulator.joints.trajectories import ErrorCode as Refusal
from robots.simulator.joints.trajectories import check, joints_of, missed

HEAD = ["head_1_joint", "head_2_joint"]
CONTROLLERS = sorted({joint.controller for joint in JOINTS.values()})


@pytest.fixture
def player():
    return Player(load_motions())


def ways(player: Player, run) -> float:
    """Step until the run ends; return its duration, s. Checks that no joint exceeds its speed and limits."""
    player.step(0.0)
    tick = 0
    while run.phase is Phase.MOVING:
        tick += 1
        player.step(tick / 50)
        for name, speed in player.velocities.items():
            assert abs(speed) <= JOINTS[name].speed * 1.001
            assert JOINTS[name].low <= player.positions[name] <= JOINTS[name].high
        assert tick < 50 * 60
    return tick / 50


@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("end", ["low", "high"])
def test_a_too_fast_trajectory_gets_the_joints_best(player, controller, end):
    joints = joints_of(controller)
    beyond = [getattr(JOINTS[joint], end) + (9.0 if end == "high" else -9.0) for joint in joints]
    goal = Point(beyond, 0.01)
    ways(player, player.follow(joints, [goal], 0.0))
    assert [player.positions[joint] for joint in joints] == [getattr(JOINTS[joint], end) for joint in joints]
    assert missed(joints, goal, player.positions) == joints


def test_the_limits_are_tiagos():
    degrees = {name: (math.degrees(JOINTS[name].low), math.degrees(JOINTS[name].high)) for name in HEAD}
    assert degrees["head_1_joint"] == pytest.approx((-75, 75))
    assert degrees["head_2_joint"] == pytest.approx((-60, 45))
    assert JOINTS["head_1_joint"].speed == JOINTS["head_2_joint"].speed == 3.0
    assert JOINTS["torso_lift_joint"][1:] == (0.0, 0.35, 0.07)
    assert JOINTS["gripper_left_finger_joint"][1:3] == (0.0, 0.045)


def test_a_slow_trajectory_takes_the_time_it_asks_for(player):
    points = [Point([0.3, 0.0], 1.0), Point([0.3, -0.2], 2.5)]
    assert ways(player, player.follow(HEAD, points, 0.0)) == pytest.approx(2.5, abs=0.04)
    assert missed(HEAD, points[-1], player.positions) == []


@pytest.mark.parametrize("name", sorted(load_motions()))
def test_no_motion_moves_a_joint_faster_than_it_can(player, name):
    ways(player, player.start(name, 0.0))


def test_a_motion_finds_a_controller_with_a_trajectory_busy(player):
    player.follow(HEAD, [Point([1.0, 0.0], 2.0)], 0.0)
    with pytest.raises(RefusedError, match="head_controller") as refused:
        player.start("head_tour", 0.1)
    assert refused.value.code is ErrorCode.CONTROLLER_BUSY


def test_a_trajectory_takes_over_from_a_motion(player):
    motion = player.start("head_tour", 0.0)
    run = player.follow(HEAD, [Point([-0.5, 0.0], 1.0)], 0.0)
    assert motion.phase is Phase.REPLACED
    ways(player, run)
    assert player.positions["head_1_joint"] == -0.5


@pytest.mark.parametrize(
    ("joints", "points", "code"),
    [
        (["head_1_joint"], [Point([0.0], 1.0)], Refusal.INVALID_JOINTS),
        (["arm_1_joint", "head_1_joint"], [Point([0.0, 0.0], 1.0)], Refusal.INVALID_JOINTS),
        (HEAD, [], Refusal.INVALID_GOAL),
        (HEAD, [Point([0.0], 1.0)], Refusal.INVALID_GOAL),
        (HEAD, [Point([0.0, 0.0], -1.0)], Refusal.INVALID_GOAL),
        (HEAD, [Point([0.0, 0.0], 1.0), Point([0.1, 0.0], 1.0)], Refusal.INVALID_GOAL),
        (HEAD, [Point([math.nan, 0.0], 1.0)], Refusal.INVALID_GOAL),
    ],
)
def test_a_trajectory_that_makes_no_sense_is_refused(joints, points, code):
    with pytest.raises(RefusedError) as refused:
        check("head_controller", joints, points)
    assert refused.value.code is code
