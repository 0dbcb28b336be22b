"""The joint trajectory controllers' topics and actions."""

from __future__ import annotations

import queue
from typing import Any, NamedTuple

import rospy
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from robots.shared.ros.message_types.classes import message_class
from robots.simulator.joints.joint_table import JOINTS
from robots.simulator.joints.motions import Phase, Point, Run
from robots.simulator.joints.trajectories import ErrorCode, RefusedTrajectoryError, check, joints_of, missed
from robots.simulator.robot import Robot
from robots.simulator.ros.actions.action_server import Goals

CONTROLLERS = sorted({joint.controller for joint in JOINTS.values()})


class Following(NamedTuple):
    """The running goal of the action."""

    handle: Any
    run: Run
    goal: Point


class TrajectoryController:
    """One controller: `command`, `state` and `follow_joint_trajectory`. A trajectory begins at once."""

    def __init__(self, robot: Robot, name: str) -> None:
        self._robot = robot
        self._player = robot.player
        self._name = name
        self._joints = joints_of(name)
        self._following: Following | None = None
        self._state_type = message_class("control_msgs/JointTrajectoryControllerState")
        self._result = message_class("control_msgs/FollowJointTrajectoryResult")
        self._state = rospy.Publisher(f"/{name}/state", self._state_type, queue_size=1)
        self._commands: queue.SimpleQueue[JointTrajectory] = queue.SimpleQueue()
        rospy.Subscriber(f"/{name}/command", JointTrajectory, self._commands.put)
        self._goals = Goals(f"/{name}/follow_joint_trajectory", "control_msgs/FollowJointTrajectoryAction")

    def step(self, now: float) -> None:
        """Take requests since the last tick, then report whether the goal ended."""
        while not self._commands.empty():
            self._command(self._commands.get(), now)
        if self._robot.faults.controllers_silent:
            return
        for is_goal, handle in self._goals.arrived():
            if is_goal:
                self._begin(handle, now)
            else:
                self._cancel(handle)
        self._report_end()

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
        except RefusedTrajectoryError as refused:
            rospy.logwarn("%s ignored a command: %s", self._name, refused)

    def _begin(self, handle: Any, now: float) -> None:
        trajectory = handle.get_goal().trajectory
        try:
            run = self._follow(trajectory, now)
        except RefusedTrajectoryError as refused:
            handle.set_rejected(self._result(int(refused.code), str(refused)), str(refused))
            return
        self._report_end()  # of the previous goal, which this goal replaced
        handle.set_accepted()
        self._following = Following(handle, run, _points(trajectory)[-1])

    def _follow(self, trajectory: JointTrajectory, now: float) -> Run:
        points = _points(trajectory)
        check(self._name, trajectory.joint_names, points)
        return self._player.follow(trajectory.joint_names, points, now)

    def _cancel(self, handle: Any) -> None:
        if self._following is not None and self._following.handle == handle:
            self._player.cancel(self._following.run)
            self._report_end()

    def _report_end(self) -> None:
        if self._following is None or self._following.run.phase is Phase.MOVING:
            return
        handle, run, goal = self._following
        self._following = None
        if run.phase is not Phase.DONE:
            handle.set_canceled(self._result(), run.phase.value)
        elif late := missed(run.joints, goal, self._player.positions):
            text = f"these joints missed the goal: {', '.join(late)}"
            handle.set_aborted(self._result(int(ErrorCode.GOAL_TOLERANCE_VIOLATED), text), text)
        else:
            handle.set_succeeded(self._result(int(ErrorCode.SUCCESSFUL), ""))


def _points(trajectory: JointTrajectory) -> list[Point]:
    return [Point(list(point.positions), point.time_from_start.to_sec()) for point in trajectory.points]
