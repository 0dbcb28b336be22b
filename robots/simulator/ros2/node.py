"""The simulated robot as nodes of ROS 2, with PAL's names."""

from __future__ import annotations

from robots.simulator.actions.controllers import CONTROLLERS, TrajectoryController
from robots.simulator.actions.gripper import GripperAction
from robots.simulator.actions.head import HeadServer
from robots.simulator.joints.looks import description
from robots.simulator.node import CameraOptions, Duty, SimulatorNode
from robots.simulator.physics.mux import TIAGO_INPUTS_ROS2
from robots.simulator.robot import Robot
from robots.simulator.ros2.motions import PlayMotion2Server
from robots.simulator.ros2.navigation import NavigateToPoseServer
from robots.simulator.ros2.side import RclpySide
from robots.simulator.ros2.speech import TtsEngineServer
from robots.simulator.topics.base import BaseTopics

BEHIND_THE_MUX = "/mobile_base_controller/cmd_vel_unstamped"


def simulator_node(ros: RclpySide, robot: Robot, name: str, cameras: CameraOptions) -> SimulatorNode:
    """Advertise and serve everything that this robot has in ROS 2."""
    names = robot.body.names
    if names.mux:
        base = BaseTopics(ros, robot, BEHIND_THE_MUX, TIAGO_INPUTS_ROS2)
    else:
        base = BaseTopics(ros, robot, names.command, {})
    node = SimulatorNode(ros, robot, base)
    _describe(ros, description(robot.body, name))
    if names.mux:
        node.serve(NavigateToPoseServer(ros, robot).step)
    if robot.body.upper_body:
        node.serve(TtsEngineServer(ros).step, PlayMotion2Server(ros, robot).step)
        for controller in CONTROLLERS:
            topic = f"/{controller}/joint_trajectory"
            node.serve(TrajectoryController(ros, robot, controller, topic).step)
        head = HeadServer(ros, robot)
        node.serve(head.take_goals, GripperAction(ros, robot, "/gripper_controller/gripper_cmd").step)
        node.add(Duty(10, 4, head.publish))
    node.add_cameras(cameras)
    node.add_laser()
    return node


def _describe(ros: RclpySide, text: str) -> None:
    """Publish the robot's description, which is also a parameter, as of robot_state_publisher."""
    ros.add_node("robot_state_publisher").declare_parameter("robot_description", text)
    topic = ros.publisher("/robot_description", "std_msgs/String", kept=True)
    topic.publish(ros.new("std_msgs/String", data=text))
