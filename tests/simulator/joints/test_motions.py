"""Recorded motions: start, refusal, end, cancel."""

from __future__ import annotations

import pytest

from robots.simulator.joints.joint_table import HOME, JOINTS
from robots.simulator.joints.motions import ErrorCode, Phase, Player, RefusedError, load_motions

# The motions of the TIAGo with gripper.
NAMES = [
    "home",
    "unfold_arm",
    "hold_object_home",
    "reach_floor",
    "reach_max",
    "prepare_grasp",
    "inspect_surroundings",
    "open",
    "close",
    "close_half",
    "point",
    "wave",
    "pregrasp_weight",
    "do_weights",
    "offer",
    "shake_hands",
    "pick_from_floor",
    "head_tour",
]


@pytest.fixture
def player():
    return Player(load_motions())


def play(player: Player, seconds: float, since: float = 0.0) -> None:
    for tick in range(round(seconds * 50) + 1):
        player.step(since + tick / 50)


def test_all_motions_are_there():
    assert sorted(load_motions()) == sorted(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_every_motion_stays_within_the_joints_limits(name):
    motion = load_motions()[name]
    times = [point.time_from_start for point in motion.points]
    assert times == sorted(times)
    for point in motion.points:
        for joint, position in zip(motion.joints, point.positions, strict=True):
            assert JOINTS[joint].low <= position <= JOINTS[joint].high


@pytest.mark.parametrize("name", NAMES)
def test_every_motion_ends_at_its_last_point_without_a_jump(name, player):
    run = player.start(name, 0.0)
    before = dict(player.positions)
    for tick in range(50 * 60):
        player.step(tick / 50)
        for joint, position in player.positions.items():
            assert abs(position - before[joint]) < 0.2
        before = dict(player.positions)
        if run.phase is Phase.DONE:
            break
    assert run.phase is Phase.DONE
    assert player.is_there(name, 0.001)


def test_an_unknown_motion_is_refused(player):
    with pytest.raises(RefusedError) as refused:
        player.start("dance", 0.0)
    assert refused.value.code is ErrorCode.MOTION_NOT_FOUND


def test_a_second_motion_of_the_same_controller_is_busy(player):
    player.start("wave", 0.0)
    with pytest.raises(RefusedError, match="arm_controller") as refused:
        player.start("home", 0.1)
    assert refused.value.code is ErrorCode.CONTROLLER_BUSY


def test_another_controllers_motion_runs_in_parallel(player):
    player.start("wave", 0.0)
    player.start("open", 0.0)
    play(player, 2.0)
    assert player.is_there("open", 0.001)


def test_a_cancelled_motion_stays_where_it_is(player):
    run = player.start("open", 0.0)
    play(player, 0.4)
    player.cancel(run)
    opened = player.positions["gripper_left_finger_joint"]
    play(player, 2.0, since=0.4)
    assert run.phase is Phase.CANCELLED
    assert HOME["gripper_left_finger_joint"] < opened < 0.044
    assert player.positions["gripper_left_finger_joint"] == opened


def test_a_failing_motion_ends_halfway_and_frees_its_controller(player):
    run = player.start("open", 0.0, fails=True)
    play(player, 2.0)
    assert run.phase is Phase.FAILED
    assert not player.is_there("open", 0.001)
    player.start("open", 3.0)
