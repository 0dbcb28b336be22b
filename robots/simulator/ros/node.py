"""The simulated robot as a node of ROS 1."""

from __future__ import annotations

import rospy

from robots.simulator.actions.controllers import CONTROLLERS, TrajectoryController
from robots.simulator.actions.gripper import GripperAction
from robots.simulator.actions.head import HeadServer
from robots.simulator.joints.looks import description
from robots.simulator.node import CameraOptions, Duty, SimulatorNode
from robots.simulator.physics.mux import TIAGO_INPUTS
from robots.simulator.robot import Robot
from robots.simulator.ros.actions.controllers import ControllerState
from robots.simulator.ros.actions.gripper import GripperServer
from robots.simulator.ros.actions.motions import PlayMotionServer
from robots.simulator.ros.actions.move_base import MoveBaseServer
from robots.simulator.ros.actions.speech import TtsServer
from robots.simulator.ros.side import RospySide
from robots.simulator.topics.base import BaseTopics
from robots.simulator.topics.velocities import Velocities


def simulator_node(robot: Robot, cameras: CameraOptions) -> SimulatorNode:
    """Advertise and serve everything that this robot has in ROS 1."""
    ros, names = RospySide(), robot.body.names
    base = BaseTopics(ros, robot, names.command, TIAGO_INPUTS if names.mux else {}, Velocities(ros))
    node = SimulatorNode(ros, robot, base)
    if names.mux:
        node.serve(MoveBaseServer(ros, robot).step)
    if robot.body.upper_body:
        _add_upper_body(node, ros, robot)
    node.add_cameras(cameras)
    node.add_laser()
    return node


def set_parameters(robot: Robot, name: str) -> None:
    """Set the robot's parameters on its master."""
    rospy.set_param("/robot_description", description(robot.body, name))
    for motion_name, motion in robot.player.motions.items():
        rospy.set_param(f"/play_motion/motions/{motion_name}", motion.parameters())


def _add_upper_body(node: SimulatorNode, ros: RospySide, robot: Robot) -> None:
    node.serve(
        TtsServer(ros).step,
        PlayMotionServer(ros, robot).step,
        GripperServer(ros, robot).step,
        GripperAction(ros, robot, "/gripper_controller/gripper_action").step,
    )
    for index, name in enumerate(CONTROLLERS):
        node.serve(TrajectoryController(ros, robot, name, f"/{name}/command").step)
        node.add(Duty(10, index, ControllerState(ros, robot, name).publish))
    head = HeadServer(ros, robot)
    node.serve(head.take_goals)
    node.add(Duty(10, 4, head.publish))
