"""The arm from joint states to the footprint: a stretched arm stops the robot before a wall."""

from __future__ import annotations

import math
from contextlib import contextmanager

import pytest
import rospy
from geometry_msgs.msg import Pose2D
from nav_msgs.msg import Odometry
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from tests.ros.bridge_support import drivable, running_bridge, tiago_config
from tests.ros.tiago_arm import ARM, JOINT_STATES, JOINTS

AHEAD = [1.5, 0.0, -0.3, 0.3, -1.2, 0.3, 0.0]  # the hand is 1.03 m ahead of the base's centre
BEFORE_WALL = Pose2D(7.6, 2.6, -math.pi / 2.0)  # the wall's face is at y = 0


@pytest.fixture(scope="module", autouse=True)
def robot(ros, simulator):
    return simulator(seed=1)


@contextmanager
def bridge(master, folder):
    topics = {"arm": ARM, "joint_states": JOINT_STATES}
    config = tiago_config(master, folder, topics=topics, gate={"has_arm": True, "has_depth": False})
    with running_bridge(config, master, folder) as (_, hand):
        hand.state_until(drivable, "a robot that can be driven")
        yield hand


def arm_limits(state):
    return [limit.text for limit in state.verdict.limits if "arm" in limit.text]


def reach_out(ros):
    with ros.speak("/arm_controller/command", JointTrajectory) as command:
        point = JointTrajectoryPoint(positions=AHEAD, time_from_start=rospy.Duration.from_sec(0.1))
        command.publish(JointTrajectory(joint_names=JOINTS, points=[point]))


def test_an_arm_that_reaches_out_keeps_clear_of_the_wall(ros, rosmaster, tmp_path):
    with (
        bridge(rosmaster, tmp_path) as hand,
        ros.listen("/ground_truth/pose", Odometry) as truth,
        ros.listen("/ground_truth/contacts", String) as contacts,
        ros.speak("/ground_truth/teleport", Pose2D) as teleport,
    ):
        hand.take_control(1)  # limits are reported to the driver
        hand.state_until(lambda state: not arm_limits(state) and not state.arm, "an arm at home")
        teleport.publish(BEFORE_WALL)
        truth.until(lambda message: abs(message.pose.pose.position.y - BEFORE_WALL.y) < 0.01)
        reach_out(ros)
        contacts.drain()
        state = hand.drive_until(
            0.5, lambda state: state.verdict.code == "obstacle" and state.odometry.vx < 0.01, "a stop"
        )
        [*_, last] = truth.drain()
    assert arm_limits(state) == [], "the robot's description tells where the arm is"
    assert 1.03 < last.pose.pose.position.y < 1.4
    assert '"contacts": [{' not in "".join(message.data for message in contacts.drain())
