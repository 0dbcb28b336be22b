"""The joint trajectory controllers' topics and actions."""

from __future__ import annotations

import queue
from typing import Any

import rospy
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from robots.shared.ros.message_types.classes import message_class
from robots.simulator.joints.joint_table import JOINTS
from robots.simulator.joints.motions import Phase, Point, RefusedError, Run
from robots.simulator.joints.trajectories import ErrorCode, check, joints_of, missed
from robots.simulator.robot import Robot
from robots.simulator.ros.actions.action_server import RunServer

CONTROLLERS = sorted({joint.controller for joint in JOINTS.values()})


class TrajectoryController(RunServer):
    """One controller: `command`, `state` and `follow_joint_trajectory`. A trajectory begins at once."""

    def __init__(self, robot: Robot, name: str) -> None:
        super().__init__(
            robot.player, f"/{name}/follow_joint_trajectory", "control_msgs/FollowJointTrajectoryAction"
        )
        self._robot = robot
        self._name = name
        self._joints = joints_of(name)
        self._state_type = message_class("control_msgs/JointTrajectoryControllerState")
        self._result = message_class("control_msgs/FollowJointTrajectoryResult")
        self._state = rospy.Publisher(f"/{name}/state", self._state_type, queue_size=1)
        self._commands: queue.SimpleQueue[JointTrajectory] = queue.SimpleQueue()
        rospy.Subscriber(f"/{name}/command", JointTrajectory, self._commands.put)

    def step(self, now: float) -> None:
        """Take requests since the last tick, then report whether the goal ended."""
        while not self._commands.empty():
            self._command(self._commands.get(), now)
        if not self._robot.faults.controllers_silent:
            self.take_goals(now)

    def publish(self, stamp: rospy.Time) -> None:
        """Publish the joints. They never lag: desired and actual are the same."""
        if not self._state.get_num_connections():
            return
        there = JointTrajectoryPoint(
            positions=[self._player.positions[joint] for joint in self._joints],
            velocities=[self._player.velocities[joint] for joint in self._joints],
        )
        none = [0.0] * len(self._joints)
        message = self._state_type(joint_names=self._joints, desired=there, actual=there)
        message.error = JointTrajectoryPoint(positions=none, velocities=none)
        message.header.stamp = stamp
        self._state.publish(message)

    def _command(self, trajectory: JointTrajectory, now: float) -> None:
        if not trajectory.points:
            # Stop the joints at their present positions, like joint_trajectory_controller.
            self._player.release(frozenset({self._name}))
            return
        try:
            self._follow(trajectory, now)
        except RefusedError as refused:
            rospy.logwarn("%s ignored a command: %s", self._name, refused)

    def _begin(self, handle: Any, now: float) -> None:
        trajectory = handle.get_goal().trajectory
        try:
            run = self._follow(trajectory, now)
        except RefusedError as refused:
            handle.set_rejected(self._result(int(refused.code), str(refused)), str(refused))
        else:
            self._accept(handle, run, _points(trajectory)[-1])

    def _follow(self, trajectory: JointTrajectory, now: float) -> Run:
        points = _points(trajectory)
        check(self._name, trajectory.joint_names, points)
        return self._player.follow(trajectory.joint_names, points, now)

    def _end(self, handle: Any, run: Run, aim: Point) -> None:
        if run.phase is not Phase.DONE:
            handle.set_canceled(self._result(), run.phase.value)
        elif late := missed(run.joints, aim, self._player.positions):
            text = f"these joints missed the goal: {', '.join(late)}"
            handle.set_aborted(self._result(int(ErrorCode.GOAL_TOLERANCE_VIOLATED), text), text)
        else:
            handle.set_succeeded(self._result(int(ErrorCode.SUCCESSFUL), ""))


def _points(trajectory: JointTrajectory) -> list[Point]:
    return [Point(list(point.positions), point.time_from_start.to_sec()) for point in trajectory.points]
