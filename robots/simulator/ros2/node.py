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
from robots.simulator.ros2.speech import SaySkill, TtsEngineServer
from robots.simulator.topics.base import BaseTopics
from robots.simulator.topics.velocities import Velocities

CONTROLLER = "/mobile_base_controller"


def simulator_node(
    ros: RclpySide, robot: Robot, name: str, cameras: CameraOptions, *, later: bool
) -> SimulatorNode:
    """Advertise and serve everything that this robot has in ROS 2; `later`: with the names of later software."""
    names, velocities = robot.body.names, Velocities(ros, stamped=later)
    if names.mux:
        behind = f"{CONTROLLER}/cmd_vel" if later else f"{CONTROLLER}/cmd_vel_unstamped"
        base = BaseTopics(ros, robot, behind, TIAGO_INPUTS_ROS2, velocities)
    else:
        base = BaseTopics(ros, robot, names.command, {}, velocities)
    node = SimulatorNode(ros, robot, base)
    _describe(ros, description(robot.body, name))
    if names.mux:
        node.serve(NavigateToPoseServer(ros, robot, velocities).step)
    if robot.body.upper_body:
        speech = SaySkill(ros) if later else TtsEngineServer(ros)
        node.serve(speech.step, PlayMotion2Server(ros, robot).step)
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
