"""The depth camera from the robot to the gate: the bridge subscribes when needed; a table top stops the robot."""

from __future__ import annotations

import math
import re
from contextlib import contextmanager

import pytest
from msgspec.structs import replace

from robots.shared import wire
from robots.shared.processes.probe_findings import BRIDGE
from tests.processes import until
from tests.ros.bridge_support import drivable, running_bridge

# The table's edge is at y = 1.0, its legs are left and right of the path.
BEFORE_TABLE = (5.0, 2.9, -math.pi / 2.0)
EDGE_Y = 1.0


@pytest.fixture(scope="module")
def robot(simulator):
    return simulator(seed=1)


@pytest.fixture
def bridge(side, robot, tmp_path):
    """``with bridge("head") as hand``: a link to a robot with a depth camera and these parts."""

    @contextmanager
    def begin(*parts: str, depth=side.topics.depth):
        config = side.config(tmp_path, *parts, topics={"depth": depth})
        with running_bridge(config, side, tmp_path) as (_, hand):
            hand.state_until(drivable, "a robot that can be driven")
            yield hand

    return begin


@pytest.fixture
def head(side):
    return side.topics.head


@pytest.fixture
def turn(visitor, robot, head):
    """``turn(radians)`` turns the head, beside the bridge, and waits until it has turned."""

    def begin(pan: float) -> None:
        with (
            visitor.listen("/joint_states", "sensor_msgs/JointState") as joints,
            visitor.speak(head.topic, "trajectory_msgs/JointTrajectory") as trajectories,
        ):
            names = [head.pan_joint, head.tilt_joint]
            points = [{"positions": [pan, 0.0], "time_from_start": 0.3}]
            trajectories.publish(joint_names=names, points=points)
            joints.until(
                lambda state: is_at(state, head.pan_joint, pan) and is_at(state, head.tilt_joint, 0.0)
            )

    return begin


@pytest.fixture
def stage(visitor, turn):
    """Place the robot before the table, its head ahead; yield its ground truth and its contacts."""
    turn(0.0)
    with (
        visitor.at(*BEFORE_TABLE) as truth,
        visitor.listen("/ground_truth/contacts", "std_msgs/String") as contacts,
    ):
        yield truth, contacts


def is_at(state, joint: str, radians: float) -> bool:
    return abs(state.position[state.name.index(joint)] - radians) < 0.01


def depth_limits(state: wire.State) -> list[str]:
    return [limit.text for limit in state.verdict.limits if "depth" in limit.text]


@pytest.mark.parametrize("form", ["pictures", "cloud"])
def test_the_robot_drives_fast_at_a_table_and_stops_at_its_edge(side, stage, bridge, form):
    truth, contacts = stage
    depth = side.topics.depth
    if form == "cloud":
        cloud = side.type("sensor_msgs/PointCloud2")
        depth = replace(depth, topic="/xtion/depth_registered/points", type=cloud, info=None)
    with bridge(depth=depth) as hand:
        hand.take_control(1)
        hand.state_until(lambda state: not depth_limits(state), "pictures of the way ahead")
        contacts.drain()
        truth.drain()
        hand.drive_until(1.0, lambda state: state.odometry.vx > 0.5, "well above the blind speed")
        state = hand.drive_until(
            1.0, lambda state: state.verdict.code == "obstacle" and state.odometry.vx < 0.01, "a stop"
        )
        drive = truth.drain()
    gap = drive[-1].pose.pose.position.y - 0.27 - EDGE_Y
    assert 0.0 < gap < 0.2
    assert state.verdict.text.startswith("stopped (")
    assert "depth" in state.verdict.text
    assert re.search(r"m ahead(; no sensor sees this place now: .*)?$", state.verdict.text)
    assert state.verdict.side == "ahead"
    assert '"contacts": [{' not in "".join(message.data for message in contacts.drain())


def test_the_camera_is_read_only_during_control(side, stage, bridge, visitor):
    def reads(topic: str) -> bool:
        return BRIDGE in visitor.listeners(topic)

    camera = side.topics.depth.topic
    with bridge() as hand:
        assert not reads(camera)
        hand.take_control(1)
        until(lambda: reads(camera), "it listens while somebody has control")
        hand.let_go()
        hand.send(wire.Revoke(1, "enough"))
        until(lambda: not reads(camera), "nobody needs it")
        assert not reads("/tf")
        hand.send(wire.Viewers(["Ann"]))
        hand.state_until(lambda state: state.watchers == ["Ann"], "somebody who looks")
        assert not reads(camera)


def test_a_head_turned_away_is_reported_until_it_is_back(stage, bridge, turn):
    with bridge() as hand:
        hand.take_control(1)
        hand.state_until(lambda state: not depth_limits(state), "a free way ahead")
        turn(1.2)
        try:  # while the head turns, the last picture may grow old: this limit is shown a moment longer
            away = ["at most 0.3 m/s: the depth camera looks away from the way ahead"]
            hand.state_until(lambda state: depth_limits(state) == away, "head away")
        finally:
            turn(0.0)
        hand.state_until(lambda state: not depth_limits(state), "a free way ahead again")
        state = hand.state_until(lambda state: True, "any")
        assert next(sensor for sensor in state.sensors if sensor.kind == "depth").ok


def test_a_dead_camera_is_said_within_a_second(stage, bridge, fault):
    with bridge() as hand:
        hand.take_control(1)
        hand.state_until(lambda state: not depth_limits(state), "a free way ahead")
        fault("depth_dead")
        state = hand.state_until(depth_limits, "a limit")
        assert "old" in depth_limits(state)[0]
        fault("none")
        hand.state_until(lambda state: not depth_limits(state), "a free way ahead again")


def test_the_head_looks_ahead_on_request_and_this_is_recorded(stage, bridge, head, visitor, tmp_path):
    with bridge("head") as hand, visitor.listen("/joint_states", "sensor_msgs/JointState") as joints:
        hand.take_control(1)
        hand.state_until(lambda state: not depth_limits(state), "a free way ahead")
        hand.send(wire.LookAhead(1))
        joints.until(lambda state: is_at(state, head.tilt_joint, head.look_tilt))
        assert "head.look_ahead" in (next(tmp_path.glob("*.records"))).read_text()
        hand.state_until(lambda state: not depth_limits(state), "a free way ahead, seen from above")
        hand.send(wire.LookAhead(2))
        hand.until(
            lambda r: isinstance(r, wire.Refused) and r.of == "look_ahead", "only the holder is obeyed"
        )


def test_a_drag_turns_the_head_from_where_another_node_left_it(stage, bridge, head, turn, visitor):
    with (
        bridge("head", "arm", "joint_states") as hand,
        visitor.listen("/joint_states", "sensor_msgs/JointState") as joints,
    ):
        hand.take_control(1)
        turn(0.6)
        joints.drain()
        # 0.4 s at 50 Hz: the bridge reads joints ten times a second, so it has read the last position
        for _ in range(20):
            joints.next()
        hand.send(wire.TurnHead(1, 0.2, 0.0))
        joints.until(lambda state: is_at(state, head.pan_joint, 0.8))
