"""A robot that moves although it is stopped: when this is said, when it ends, and its records."""

from __future__ import annotations

from collections.abc import Iterator

import msgspec
import pytest

from robots.bridge.lease.motion_after_stop import CREEPS_S, STANDS_S
from robots.bridge.lease.state_store import SavedState
from robots.bridge.robot_reports import RosStatus
from robots.shared import wire
from robots.shared.configuration.bridge_config import ArmSource, HeadSource, LimbSource, Topic
from robots.shared.geometry.poses import STILL, Velocity
from tests.bridge.support import CONFIG, Bench

DRIVES, TURNS = Velocity(0.3, 0.0, 0.0), Velocity(0.0, 0.0, -0.4)
TICK_S = 0.05
ROGUE = {"/base/cmd_vel": ["/rogue"]}
JOINTS = msgspec.structs.replace(
    CONFIG.topics,
    joint_states=Topic("/joint_states", "sensor_msgs/JointState"),
    arm=ArmSource({"arm_1": 0.0}, ["arm_1_link"]),
    head=HeadSource("/head", "pan", "tilt"),
    torso=LimbSource("/torso", ["lift"], (0.0, 0.3), 0.07),
)


@pytest.fixture
def bench() -> Iterator[Bench]:
    with_joints = Bench(config=msgspec.structs.replace(CONFIG, topics=JOINTS)).online()
    yield with_joints
    with_joints.close()


def fact(bench: Bench) -> wire.MovesAlthoughStopped | None:
    return bench.core.state(bench.now_s, []).moves_although_stopped


def records(bench: Bench) -> list[object]:
    bench.recorded()
    return [what for kind, what in bench.sink.records if kind == "stop.moves"]


def stop(bench: Bench) -> Bench:
    bench.core.stop("Bob", "", bench.now_s)
    return bench


def moves(bench: Bench, speed: Velocity, seconds: float) -> None:
    """Let time pass in ticks of 50 ms while the robot moves like this."""
    bench.speed = speed
    for _ in range(round(seconds / TICK_S)):
        bench.x += speed.vx * TICK_S
        bench.yaw += speed.w * TICK_S
        bench.pass_time(TICK_S)


def test_a_robot_that_drives_on_is_reported(bench):
    bench.core.ros_status(RosStatus("connecting", "", velocities=ROGUE), bench.now_s)
    moves(bench, DRIVES, 0.2)
    moves(stop(bench), DRIVES, 3.0)
    told = fact(bench)
    assert (told.parts, told.speed_mps, told.turn_radps) == (["base"], 0.3, 0.0)
    assert told.publishers == ROGUE and 0.5 < told.since_s < 3.0
    assert told.text == "It drives at 0.3 m/s. Velocities for its base come from /rogue on /base/cmd_vel."
    [begun] = records(bench)
    assert begun == {
        "number": 1,
        "parts": "base",
        "top_mps": 0.3,
        "top_radps": 0.0,
        "publishers": "/rogue on /base/cmd_vel",
    }


def test_a_robot_that_brakes_in_time_is_not_reported(bench):
    speeds = [0.9 - 0.05 * step for step in range(18)]  # at 1 m/s2, in ticks of 50 ms
    moves(bench, Velocity(0.95, 0.0, 0.0), 0.2)
    stop(bench)
    for speed in speeds:
        moves(bench, Velocity(speed, 0.0, 0.0), 0.05)
        assert fact(bench) is None
    moves(bench, STILL, 5.0)
    assert fact(bench) is None and not records(bench)


def test_motion_after_standstill_is_one_event_with_one_end(bench):
    moves(stop(bench), STILL, 5.0)
    assert bench.core.stop_state.state == "stopped" and fact(bench) is None
    for _ in range(3):  # a navigation that makes pauses
        moves(bench, TURNS, 1.0)
        assert fact(bench).turn_radps == -0.4
        moves(bench, STILL, STANDS_S - 0.2)
        assert fact(bench) is not None
    assert len(records(bench)) == 1
    moves(bench, STILL, 1.0)
    assert fact(bench) is None
    _, end = records(bench)
    assert (end.outcome, end.top_radps, end.parts) == ("stood", 0.4, "base")


def test_short_jerks_with_pauses_are_reported(bench):
    moves(stop(bench), STILL, 2.0)
    for _ in range(8):
        moves(bench, DRIVES, 0.15)
        moves(bench, STILL, 0.2)
    assert fact(bench) is not None


@pytest.mark.parametrize("jerk", [Velocity(0.15, 0.0, 0.0), Velocity(0.0, 0.0, 0.4)])
def test_seldom_jerks_are_one_event_by_the_way_they_make(bench, jerk):
    """A node fights with the stop's zeros: the base moves for a twentieth of the time, and stands between."""
    moves(stop(bench), STILL, 2.0)
    for _ in range(20):
        moves(bench, jerk, 0.1)
        moves(bench, STILL, STANDS_S - 0.5)
    assert fact(bench).parts == ["base"] and len(records(bench)) == 1
    moves(bench, STILL, CREEPS_S + 1.0)
    assert fact(bench) is None and records(bench)[1].outcome == "stood"


def test_a_slow_roll_is_reported(bench):
    moves(stop(bench), STILL, 2.0)
    moves(bench, Velocity(-0.008, 0.0, 0.0), CREEPS_S)
    assert fact(bench).parts == ["base"]


@pytest.mark.parametrize("before", [(0.4, 0.0), (0.0, 1.0), (2.0, 1.0)])
def test_odometry_that_begins_again_is_no_motion(bench, before):
    bench.x, bench.yaw = before
    moves(stop(bench), STILL, 5.0)
    bench.x = bench.yaw = 0.0
    moves(bench, STILL, 5.0)
    assert fact(bench) is None


def test_a_bump_is_not_reported(bench):
    moves(stop(bench), STILL, 2.0)
    moves(bench, DRIVES, 0.2)
    moves(bench, STILL, 3.0)
    assert fact(bench) is None and not records(bench)


def test_noise_at_standstill_is_not_reported(bench):
    moves(stop(bench), STILL, 2.0)
    for step in range(200):
        moves(bench, Velocity(0.004 if step % 2 else -0.004, 0.0, 0.01), 0.05)
        assert fact(bench) is None


def test_without_another_publisher_it_is_pushed_or_rolls(bench):
    moves(stop(bench), STILL, 2.0)
    moves(bench, Velocity(-0.05, 0.0, 0.0), 1.0)
    assert fact(bench).text == (
        "It drives at 0.05 m/s. No other node is known that sends velocities: somebody pushes it, or it rolls."
    )


def test_silent_odometry_leaves_the_event_unknown(bench):
    moves(stop(bench), DRIVES, 3.0)
    assert fact(bench).speed_mps == 0.3 and bench.core.state(bench.now_s, []).stands is False
    for _ in range(60):
        bench.now_s += 0.05
        bench.core.tick(bench.now_s)
    told, state = fact(bench), bench.core.state(bench.now_s, [])
    assert (told.speed_mps, told.turn_radps, state.stands) == (None, None, None)
    assert told.text.startswith("Its odometry is silent now: nobody knows whether it still moves.")


def test_a_clear_ends_the_event(bench):
    moves(stop(bench), DRIVES, 3.0)
    bench.core.clear(bench.core.stop_state.number, bench.now_s)
    moves(bench, DRIVES, 0.1)
    assert fact(bench) is None
    assert records(bench)[1].outcome == "cleared"
    moves(stop(bench), DRIVES, 3.0)
    assert fact(bench) is not None and len(records(bench)) == 3


def test_a_restarted_bridge_sees_it_again():
    bench = Bench(SavedState(True, "Ann", "", 1)).online()
    moves(bench, DRIVES, 4.0)
    assert fact(bench) is not None
    bench.core.close(bench.now_s)
    assert records(bench)[1].outcome == "bridge_ended"
    bench.close()


@pytest.mark.parametrize(
    ("joint", "step", "part"), [("arm_1", 0.03, "arm"), ("pan", -0.1, "head"), ("lift", 0.002, "torso")]
)
def test_a_part_that_moves_is_reported(bench, joint, step, part):
    bench.base.joints = {"arm_1": 0.0, "pan": 0.0, "tilt": 0.0, "lift": 0.0}
    moves(stop(bench), STILL, 3.0)
    assert fact(bench) is None
    for _ in range(60):
        bench.base.joints[joint] += step
        moves(bench, STILL, 0.05)
    assert fact(bench).parts == [part]
    assert fact(bench).text == f"Its {part} moves. Other software moves it, or somebody pushes it."
    moves(bench, STILL, STANDS_S + 1.0)
    assert fact(bench) is None


def test_a_robot_that_is_not_stopped_is_not_judged(bench):
    moves(bench, DRIVES, 5.0)
    assert fact(bench) is None and bench.core.state(bench.now_s, []).stands is False
