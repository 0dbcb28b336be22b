"""TIAGo's arm: its joints and links, where its state is published, and its robot's description."""

from __future__ import annotations

from xml.etree import ElementTree

from robots.shared.configuration.bridge_config import ArmSource, Topic
from robots.simulator.joints.frames import urdf
from robots.simulator.joints.joint_table import HOME
from robots.simulator.sensors.body import BODIES

JOINTS = [f"arm_{number}_joint" for number in range(1, 8)]
HAND = "gripper_grasping_frame"
ARM = ArmSource(
    home={joint: HOME[joint] for joint in JOINTS},
    links=[*(f"arm_{number}_link" for number in range(1, 8)), HAND],
)
JOINT_STATES = Topic("/joint_states", "sensor_msgs/JointState")
DESCRIPTION = urdf(BODIES["tiago"], "tiago-1")


def without_hand() -> str:
    """The description of a TIAGo that lacks its hand."""
    robot = ElementTree.fromstring(DESCRIPTION)  # noqa: S314 - our own
    for joint in robot.findall("joint"):
        child = joint.find("child")
        if child is not None and child.get("link") == HAND:
            robot.remove(joint)
    return ElementTree.tostring(robot, encoding="unicode")
