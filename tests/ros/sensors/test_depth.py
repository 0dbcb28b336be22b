"""The depth camera from the robot to the gate: the bridge subscribes when needed; a table top stops the robot."""

from __future__ import annotations

import math
import re
from contextlib import contextmanager

import msgspec
import pytest
from actionlib_msgs.msg import GoalID
from geometry_msgs.msg import Pose2D
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from robots.shared import wire
from robots.shared.configuration.bridge_config import DepthSource, HeadSource
from robots.shared.configuration.gate_profile import DepthView
from robots.shared.ros.message_types.classes import message_class
from tests.ros.bridge_support import drivable, running_bridge, tiago_config

IMAGES = DepthSource(
    "/xtion/depth_registered/image_raw",
    "sensor_msgs/Image",
    info="/xtion/depth_registered/camera_info",
    fov=math.radians(63.0),
    height_m=1.1,
)
CLOUDS = msgspec.structs.replace(
    IMAGES, topic="/xtion/depth_registered/points", type="sensor_msgs/PointCloud2", info=None
)
HEAD = HeadSource("/head_controller/command", "head_1_joint", "head_2_joint", look_tilt=-0.68)
HEAD_JOINTS = [HEAD.pan_joint, HEAD.tilt_joint]
# its edge is at y = 1.0, its legs are left and right of the path
BEFORE_TABLE = Pose2D(5.0, 2.9, -math.pi / 2.0)
EDGE_Y = 1.0


@contextmanager
def bridge(master, folder, source, **topics):
    view = DepthView(source.height_m, source.own_m)
    config = tiago_config(master, folder, topics={"depth": source, **topics}, gate={"depth": view})
    with running_bridge(config, master, folder) as (_, hand):
        hand.state_until(drivable, "a robot that can be driven")
        yield hand


@pytest.fixture
def stage(ros, tmp_path):
    """Place the robot before the table, its head ahead; yield its ground truth and its contacts."""
    with (
        ros.speak(HEAD.topic, JointTrajectory) as head,
        ros.listen("/joint_states", JointState) as joints,
    ):
        head.publish(turned(0.0))
        joints.until(lambda state: all(abs(position_of(state, name)) < 0.01 for name in HEAD_JOINTS))
    with (
        ros.listen("/ground_truth/pose", Odometry) as truth,
        ros.listen("/ground_truth/contacts", String) as contacts,
        ros.speak("/ground_truth/teleport", Pose2D) as teleport,
    ):
        teleport.publish(BEFORE_TABLE)
        truth.until(lambda message: abs(message.pose.pose.position.y - BEFORE_TABLE.y) < 0.01)
        yield truth, contacts


@pytest.fixture(scope="module", autouse=True)
def robot(ros, simulator):
    return simulator(seed=1)


def turned(radians: float) -> JointTrajectory:
    point = JointTrajectoryPoint(positions=[radians, 0.0])
    point.time_from_start.nsecs = 300_000_000
    return JointTrajectory(joint_names=HEAD_JOINTS, points=[point])


def position_of(state: JointState, joint: str) -> float:
    return state.position[list(state.name).index(joint)]


def depth_limits(state: wire.State) -> list[str]:
    return [limit.text for limit in state.verdict.limits if "depth" in limit.text]


@pytest.mark.parametrize("source", [CLOUDS], ids=["cloud"])
def test_the_robot_drives_fast_at_a_table_and_stops_at_its_edge(rosmaster, stage, tmp_path, source):
    truth, contacts = stage
    with bridge(rosmaster, tmp_path, source) as hand:
        hand.take_control(1)
        hand.state_until(lambda state: not depth_limits(state), "pictures of the way ahead")
        contacts.drain()
        truth.drain()
        state = hand.drive_until(
            1.0, lambda state: state.verdict.code == "obstacle" and state.odometry.vx < 0.01, "a stop"
        )
        drive = truth.drain()
    fastest = max(message.twist.twist.linear.x for message in drive)
    gap = drive[-1].pose.pose.position.y - 0.27 - EDGE_Y
    assert fastest > 0.5, "well above the blind speed"
    assert 0.0 < gap < 0.2
    assert state.verdict.text.startswith("stopped (")
    assert "depth" in state.verdict.text
    assert re.search(r"m ahead(; no sensor sees this place now: .*)?$", state.verdict.text)
    assert state.verdict.side == "ahead"
    assert '"contacts": [{' not in "".join(message.data for message in contacts.drain())


@pytest.mark.parametrize("is_offered", [True, False], ids=("action", "controller"))
def test_the_head_is_turned_by_its_action_where_offered(is_offered, ros, rosmaster, stage, tmp_path):
    action = "/head_controller/point_head_action" if is_offered else "/no_such_action"
    head = msgspec.structs.replace(HEAD, point_head=action)
    with (
        bridge(rosmaster, tmp_path, IMAGES, head=head) as hand,
        ros.listen(f"{action}/goal", message_class("control_msgs/PointHeadActionGoal")) as goals,
        ros.listen(f"{action}/cancel", GoalID) as cancels,
        ros.listen(HEAD.topic, JointTrajectory) as trajectories,
        ros.listen("/joint_states", JointState) as joints,
    ):

        def looks(pan: float, tilt: float) -> None:
            stays = 0  # messages: on its way down and up again, the head passes many places

            def is_there(state: JointState) -> bool:
                nonlocal stays
                off = (position_of(state, HEAD.pan_joint) - pan, position_of(state, HEAD.tilt_joint) - tilt)
                stays = stays + 1 if max(map(abs, off)) < 0.01 else 0
                return stays > 10

            joints.until(is_there)

        hand.take_control(1)
        hand.send(wire.LookAhead(1))
        looks(0.0, HEAD.look_tilt)
        hand.send(wire.TurnHead(1, 0.5, 0.3))
        looks(0.5, HEAD.look_tilt + 0.3)
        outcome = "done" if is_offered else "sent"  # this bridge reads no joint states
        hand.state_until(lambda state: state.head_ended and state.head_ended.outcome == outcome, outcome)
        used, unused = (goals, trajectories) if is_offered else (trajectories, goals)
        assert used.drain()
        assert not unused.drain()
        hand.send(wire.LinkStop("Bob"))
        assert cancels.next().id == "", "all goals of the action"
