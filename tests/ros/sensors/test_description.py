"""The robot's description and joints on their way from ROS to pages that draw the robot."""

from __future__ import annotations

import pytest
import rospy
from sensor_msgs.msg import JointState

from robots.bridge.arm.posture import ArmPosture
from robots.shared import wire
from tests.processes import until
from tests.ros.bridge_support import drivable, running_bridge, tiago_config
from tests.ros.support import Master
from tests.ros.tiago_arm import ARM, DESCRIPTION, JOINT_STATES, JOINTS


@pytest.fixture(scope="module", autouse=True)
def simulated(ros, simulator):
    return simulator(world="office", pose="2.0,1.8,0", seed=3)


def test_a_bridge_hands_on_description_and_joints(rosmaster: Master, tmp_path):
    config = tiago_config(rosmaster, tmp_path, topics={"arm": ARM, "joint_states": JOINT_STATES})
    with running_bridge(config, rosmaster, tmp_path) as (bridge, hand):
        until(lambda: bridge.description() == "read", "the description")
        hand.send(wire.Viewers(["Ann"]))
        until(lambda: hand.view, "a view")
        assert hand.view.joints == {}
        hand.send(wire.Viewers(["Ann"], joints=True))
        until(lambda: hand.view.joints, "joints")
        joints = hand.view.joints
        assert {*JOINTS, "torso_lift_joint", "head_1_joint"} <= joints.keys()
        assert joints["arm_2_joint"] == pytest.approx(-1.34, abs=0.05)
        assert "wheel_left_joint" not in joints  # the description has no such joint
        hand.send(wire.Viewers(["Ann"]))
        until(lambda: not hand.view.joints, "no joints any more")


def test_a_huge_description_is_named_and_the_robot_drives(rosmaster: Master, tmp_path):
    before = rospy.get_param("/robot_description")
    rospy.set_param("/robot_description", f"<robot>{'x' * 20_000_000}</robot>")
    try:
        config = tiago_config(rosmaster, tmp_path)  # no arm: the description is read all the same
        with running_bridge(config, rosmaster, tmp_path) as (bridge, hand):
            until(lambda: "is too large" in bridge.description(), "the problem")
            hand.take_control(7)
            hand.drive_until(0.5, lambda state: state.odometry and state.odometry.vx > 0.1, "a drive")
    finally:
        rospy.set_param("/robot_description", before)


def test_a_description_that_changes_under_one_master_is_read_again(rosmaster: Master, ros, tmp_path):
    before = rospy.get_param("/robot_description")
    config = tiago_config(rosmaster, tmp_path, topics={"arm": ARM, "joint_states": JOINT_STATES})
    try:
        with running_bridge(config, rosmaster, tmp_path) as (bridge, hand):
            hand.send(wire.Viewers(["Ann"], joints=True))
            until(lambda: hand.view and "head_1_joint" in hand.view.joints, "joints")
            rospy.set_param("/robot_description", before.replace("head_1_joint", "neck_joint"))
            with ros.speak("/joint_states", JointState):  # a new node that publishes the robot's joints
                until(lambda: "head_1_joint" not in hand.view.joints, "the new description")
            assert "arm_1_joint" in hand.view.joints
            rospy.set_param("/robot_description", 7)  # the bridge reads this when the node has gone
            until(lambda: "is not a text" in bridge.description(), "the problem")
            until(lambda: not hand.view.joints, "no joints")
            hand.state_until(drivable, "a robot that can be driven as at its start without description")
    finally:
        rospy.set_param("/robot_description", before)


@pytest.mark.parametrize("arm", [ARM, None], ids=["with an arm", "without"])
def test_only_joints_of_the_description_are_shown(arm, caplog):
    posture = ArmPosture(arm)
    posture.describe(DESCRIPTION)
    posture.update([("arm_1_joint", 0.123456), ("arm_2_joint", float("nan")), ("stranger", 1.0)], 100.0)
    assert posture.shown(100.1) == {"arm_1_joint": 0.1235}
    assert posture.shown(200.0) == {}
    posture.describe(None)
    assert posture.shown(100.1) == {}
    assert not caplog.records
