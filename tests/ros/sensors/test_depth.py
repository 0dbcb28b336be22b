"""The depth camera from the robot to the gate: the bridge subscribes when needed; a table top stops the robot."""

from __future__ import annotations

import math
import re
from contextlib import contextmanager

import msgspec
import pytest
import rosgraph
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
from tests.processes import until
from tests.ros.bridge_support import drivable, running_bridge, tiago_config
from tests.ros.tiago_arm import ARM, JOINT_STATES

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


def listeners(master, topic):
    _, subscribers, _ = rosgraph.Master("/test", master.uri).getSystemState()
    return [node for name, nodes in subscribers if name == topic for node in nodes if node == "/fleet_bridge"]


def depth_limits(state: wire.State) -> list[str]:
    return [limit.text for limit in state.verdict.limits if "depth" in limit.text]


def depth_sensor(state: wire.State) -> wire.Sensor:
    return next(sensor for sensor in state.sensors if sensor.kind == "depth")


@pytest.mark.parametrize("source", [IMAGES, CLOUDS], ids=["image", "cloud"])
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


def test_the_camera_is_read_only_during_control(rosmaster, stage, tmp_path):
    with bridge(rosmaster, tmp_path, IMAGES) as hand:
        assert not listeners(rosmaster, IMAGES.topic)
        hand.take_control(1)
        until(lambda: listeners(rosmaster, IMAGES.topic), "it listens while somebody has control")
        hand.let_go()
        hand.send(wire.Revoke(1, "enough"))
        until(lambda: not listeners(rosmaster, IMAGES.topic), "nobody needs it")
        assert not listeners(rosmaster, "/tf")
        hand.send(wire.Viewers(["Ann"]))
        hand.state_until(lambda state: state.watchers == ["Ann"], "somebody who looks")
        assert not listeners(rosmaster, IMAGES.topic)


def test_a_head_turned_away_is_reported_until_it_is_back(ros, rosmaster, stage, tmp_path):
    with (
        bridge(rosmaster, tmp_path, IMAGES) as hand,
        ros.speak("/head_controller/command", JointTrajectory) as head,
        ros.listen("/joint_states", JointState),
    ):
        hand.take_control(1)
        hand.state_until(lambda state: not depth_limits(state), "a free way ahead")
        head.publish(turned(1.2))
        try:  # while the head turns, the last picture may grow old: this limit is shown a moment longer
            away = ["at most 0.3 m/s: the depth camera looks away from the way ahead"]
            hand.state_until(lambda state: depth_limits(state) == away, "head away")
        finally:
            head.publish(turned(0.0))
        hand.state_until(lambda state: not depth_limits(state), "a free way ahead again")
        assert depth_sensor(hand.state_until(lambda state: True, "any")).ok


def test_a_dead_camera_is_said_within_a_second(ros, rosmaster, stage, tmp_path):
    with bridge(rosmaster, tmp_path, IMAGES) as hand, ros.speak("/ground_truth/fault", String) as fault:
        hand.take_control(1)
        hand.state_until(lambda state: not depth_limits(state), "a free way ahead")
        fault.publish("depth_dead")
        state = hand.state_until(depth_limits, "a limit")
        assert "old" in depth_limits(state)[0]
        fault.publish("none")
        hand.state_until(lambda state: not depth_limits(state), "a free way ahead again")


def test_the_head_looks_ahead_on_request_and_this_is_recorded(ros, rosmaster, stage, tmp_path):
    with (
        bridge(rosmaster, tmp_path, IMAGES, head=HEAD) as hand,
        ros.listen("/joint_states", JointState) as joints,
    ):
        hand.take_control(1)
        hand.state_until(lambda state: not depth_limits(state), "a free way ahead")
        hand.send(wire.LookAhead(1))
        joints.until(lambda state: abs(state.position[list(state.name).index(HEAD.tilt_joint)] + 0.68) < 0.01)
        assert "head.look_ahead" in (next(tmp_path.glob("*.records"))).read_text()
        hand.state_until(lambda state: not depth_limits(state), "a free way ahead, seen from above")
        hand.send(wire.LookAhead(2))
        hand.until(
            lambda r: isinstance(r, wire.Refused) and r.of == "look_ahead", "only the holder is obeyed"
        )


def test_a_drag_turns_the_head_from_where_another_node_left_it(ros, rosmaster, stage, tmp_path):
    with (
        bridge(rosmaster, tmp_path, IMAGES, head=HEAD, arm=ARM, joint_states=JOINT_STATES) as hand,
        ros.speak("/head_controller/command", JointTrajectory) as head,
        ros.listen("/joint_states", JointState) as joints,
    ):

        def pans_to(radians: float) -> None:
            joints.until(
                lambda state: abs(state.position[list(state.name).index(HEAD.pan_joint)] - radians) < 0.01
            )

        hand.take_control(1)
        head.publish(turned(0.6))
        pans_to(0.6)
        # 0.4 s at 50 Hz: the bridge reads joints ten times a second, so it has read the last position
        for _ in range(20):
            joints.next()
        hand.send(wire.TurnHead(1, 0.2, 0.0))
        pans_to(0.8)


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
