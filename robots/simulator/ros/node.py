"""The simulated robot as one ROS node: a fixed-rate loop over `Robot` that publishes its topics."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import rospy

from robots.simulator.joints.looks import description
from robots.simulator.robot import TICK_HZ, TICK_S, Robot
from robots.simulator.ros.actions.controllers import CONTROLLERS, TrajectoryController
from robots.simulator.ros.actions.gripper import GripperAction, GripperServer
from robots.simulator.ros.actions.head import HeadServer
from robots.simulator.ros.actions.motions import MotionServer
from robots.simulator.ros.actions.move_base import MoveBaseServer
from robots.simulator.ros.actions.speech import SpeechServer
from robots.simulator.ros.base import BaseTopics
from robots.simulator.ros.cameras.colour import CameraPublisher, head_camera, rear_camera
from robots.simulator.ros.cameras.depth import DepthPublisher
from robots.simulator.ros.cameras.drawing_thread import DrawingThread
from robots.simulator.ros.diagnostics import DiagnosticsTopic
from robots.simulator.ros.inertial import InertialTopics
from robots.simulator.ros.joints import JointTopics
from robots.simulator.ros.map import MapTopics
from robots.simulator.ros.power import PowerTopics
from robots.simulator.ros.sensors import LaserTopics, SonarTopic
from robots.simulator.ros.truth import GroundTruth

_LONGEST_LAG_S = 0.2


class Duty(NamedTuple):
    """A job that runs `rate_hz` times a second; `phase`, in ticks, spreads costly jobs over the ticks."""

    rate_hz: int
    phase: int
    run: Callable[[rospy.Time], None]

    def due(self, tick: int) -> bool:
        """Return whether the job runs in this tick."""
        return (tick - self.phase) * self.rate_hz % TICK_HZ < self.rate_hz


class CameraOptions(NamedTuple):
    """Encoding of depth, and whether the head's colour camera draws the clock code (`cameras.clock_code`)."""

    depth_encoding: str = "32FC1"
    clock: bool = False


class SimulatorNode:
    """Runs one robot until the stop event."""

    def __init__(self, robot: Robot, name: str, cameras: CameraOptions) -> None:
        self._robot = robot
        self._name = name
        self._tick = 0
        self.set_parameters()
        self._truth = GroundTruth(robot)
        diagnostics = DiagnosticsTopic(robot)
        self._duties = [
            Duty(TICK_HZ, 0, BaseTopics(robot).publish),
            Duty(5, 6, MapTopics(robot).publish),
            Duty(TICK_HZ, 0, JointTopics(robot).publish),
            Duty(TICK_HZ, 0, InertialTopics(robot).publish),
            Duty(1, 7, PowerTopics(robot).publish),
            Duty(1, 8, diagnostics.publish),
            Duty(TICK_HZ, 0, diagnostics.flood),
            Duty(TICK_HZ, 0, self._truth.publish_contacts),
            Duty(TICK_HZ, 0, self._truth.publish_pose),
            Duty(25, 1, self._truth.publish_clearance),
        ]
        sonars = SonarTopic(robot)
        for index, sonar in enumerate(robot.sonars):
            self._duties.append(Duty(5, 3 * index + 1, partial(sonars.publish, sonar)))
        self._servers: list[Callable[[float], None]] = []
        if robot.body.names.mux:
            self._servers.append(MoveBaseServer(robot).step)
        if robot.body.upper_body:
            self._servers += [
                SpeechServer().step,
                MotionServer(robot).step,
                GripperServer(robot).step,
                GripperAction(robot).step,
            ]
            for index, name in enumerate(CONTROLLERS):
                controller = TrajectoryController(robot, name)
                self._servers.append(controller.step)
                self._duties.append(Duty(10, index, controller.publish))
            head = HeadServer(robot)
            self._servers.append(head.take_goals)
            self._duties.append(Duty(10, 4, head.publish))
        self._drawing_thread = DrawingThread(robot.physics)
        self._duties += self._camera_duties(cameras)
        # Last, so that everything else is published before a scan.
        self._duties.append(Duty(10, 0, LaserTopics(robot).publish))

    def run(self, stop: threading.Event) -> None:
        """Tick at a fixed rate of the monotonic clock until `stop` is set."""
        due = time.monotonic()
        while not stop.wait(max(0.0, due - time.monotonic())):
            self.tick(time.monotonic())
            # After a long stall (a suspended machine) continue from now, without the missed ticks.
            due = max(due + TICK_S, time.monotonic() - _LONGEST_LAG_S)

    def tick(self, now: float) -> None:
        """Simulate one step and publish its results."""
        self._truth.step()
        self._robot.tick(now)
        for step in self._servers:
            step(now)
        stamp = rospy.Time.now()
        for duty in self._duties:
            if duty.due(self._tick):
                duty.run(stamp)
        self._tick += 1

    def set_parameters(self) -> None:
        """Set the robot's parameters on its master."""
        rospy.set_param("/robot_description", description(self._robot.body, self._name))
        for name, motion in self._robot.player.motions.items():
            rospy.set_param(f"/play_motion/motions/{name}", motion.parameters())

    def close(self) -> None:
        """End all parts that have their own thread."""
        self._drawing_thread.close()

    def _camera_duties(self, options: CameraOptions) -> list[Duty]:
        robot, thread = self._robot, self._drawing_thread
        duties = []
        if robot.body.upper_body:
            depth = DepthPublisher(robot, thread, options.depth_encoding)
            head = CameraPublisher(robot, thread, head_camera(robot, clock=options.clock))
            duties += [Duty(10, 2, depth.publish), Duty(15, 4, head.publish)]
        if robot.body.rear_camera is not None:
            rear = CameraPublisher(robot, thread, rear_camera(robot.body, robot.body.rear_camera))
            duties.append(Duty(10, 3, rear.publish))
        return duties
