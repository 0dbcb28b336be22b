"""The gripper's topic and services: both fingers are one joint, whose position is their distance."""

from __future__ import annotations

import logging
import queue
import threading
from typing import Any, NamedTuple

import rospy
from std_srvs.srv import Empty, EmptyRequest, EmptyResponse

from robots.simulator.actions.controllers import points_of
from robots.simulator.joints.joint_table import JOINTS
from robots.simulator.joints.motions import Phase, Point, RefusedError, Run
from robots.simulator.joints.trajectories import check, joints_of
from robots.simulator.robot import Robot
from robots.simulator.ros_side import RosSide

log = logging.getLogger(__name__)

JOINT = "parallel_gripper_joint"
_NAME = "/parallel_gripper_controller"
_FINGERS = joints_of("gripper_controller")
_OPEN_M = JOINTS[_FINGERS[0]].high
_PATIENCE_S = 10.0


class Awaited(NamedTuple):
    """A service call that moves the fingers, and its end condition."""

    finger_m: float
    done: threading.Event


class GripperServer:
    """`command`, `grasp` and `release`. There is no object to hold: a grasp closes the fingers."""

    def __init__(self, ros: RosSide, robot: Robot) -> None:
        self._ros = ros
        self._player = robot.player
        self._commands: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._asked: queue.SimpleQueue[Awaited] = queue.SimpleQueue()
        self._running: list[tuple[Run, threading.Event]] = []
        ros.subscribe(f"{_NAME}/command", "trajectory_msgs/JointTrajectory", self._commands.put)
        rospy.Service(f"{_NAME}/grasp", Empty, self._grasp)
        rospy.Service(f"{_NAME}/release", Empty, self._release)

    def step(self, now: float) -> None:
        """Take requests since the last tick, and answer the services whose fingers have stopped."""
        while not self._commands.empty():
            self._command(self._commands.get(), now)
        while not self._asked.empty():
            finger_m, done = self._asked.get()
            run = self._player.follow(_FINGERS, [Point([finger_m] * len(_FINGERS), 0.0)], now)
            self._running.append((run, done))
        for run, done in self._running[:]:
            if run.phase is not Phase.MOVING:
                self._running.remove((run, done))
                done.set()

    def _command(self, trajectory: Any, now: float) -> None:
        if list(trajectory.joint_names) != [JOINT] or any(len(p.positions) != 1 for p in trajectory.points):
            log.warning("the gripper ignored a command: it moves %s, one position each", JOINT)
            return
        points = [
            Point([point.positions[0] / 2.0] * len(_FINGERS), point.time_from_start)
            for point in points_of(self._ros, trajectory)
        ]
        try:
            check("gripper_controller", _FINGERS, points)
        except RefusedError as refused:
            log.warning("the gripper ignored a command: %s", refused)
            return
        self._player.follow(_FINGERS, points, now)

    def _grasp(self, _request: EmptyRequest) -> EmptyResponse:
        return self._move(0.0)

    def _release(self, _request: EmptyRequest) -> EmptyResponse:
        return self._move(_OPEN_M)

    def _move(self, finger_m: float) -> EmptyResponse:
        """Wait on a rospy thread until the robot's thread has moved the fingers."""
        done = threading.Event()
        self._asked.put(Awaited(finger_m, done))
        if not done.wait(_PATIENCE_S):
            raise rospy.ServiceException("the fingers did not come to rest")
        return EmptyResponse()
