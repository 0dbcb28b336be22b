"""The joint trajectory controllers' topics and actions."""

from __future__ import annotations

import logging
import queue
from typing import Any

from robots.simulator.actions.run_server import RunServer
from robots.simulator.joints.joint_table import JOINTS
from robots.simulator.joints.motions import Phase, Point, RefusedError, Run
from robots.simulator.joints.trajectories import ErrorCode, check, missed
from robots.simulator.robot import Robot
from robots.simulator.ros_side import Goal, RosSide

log = logging.getLogger(__name__)

CONTROLLERS = sorted({joint.controller for joint in JOINTS.values()})


class TrajectoryController(RunServer):
    """One controller: a topic of trajectories, and `follow_joint_trajectory`. A trajectory begins at once."""

    def __init__(self, ros: RosSide, robot: Robot, name: str, command: str) -> None:
        action = f"/{name}/follow_joint_trajectory"
        super().__init__(robot.player, ros.goals(action, "control_msgs/FollowJointTrajectory"))
        self._ros = ros
        self._robot = robot
        self._name = name
        self._commands: queue.SimpleQueue[Any] = queue.SimpleQueue()
        ros.subscribe(command, "trajectory_msgs/JointTrajectory", self._commands.put)

    def step(self, now: float) -> None:
        """Take requests since the last tick, then report whether the goal ended."""
        while not self._commands.empty():
            self._command(self._commands.get(), now)
        if not self._robot.faults.controllers_silent:
            self.take_goals(now)

    def _command(self, trajectory: Any, now: float) -> None:
        if not trajectory.points:
            # Stop the joints at their present positions, like joint_trajectory_controller.
            self._player.release(frozenset({self._name}))
            return
        try:
            self._follow(trajectory, now)
        except RefusedError as refused:
            log.warning("%s ignored a command: %s", self._name, refused)

    def _begin(self, goal: Goal, now: float) -> None:
        trajectory = goal.request.trajectory
        try:
            run = self._follow(trajectory, now)
        except RefusedError as refused:
            goal.reject(str(refused), error_code=int(refused.code), error_string=str(refused))
        else:
            self._accept(goal, run, points_of(self._ros, trajectory)[-1])

    def _follow(self, trajectory: Any, now: float) -> Run:
        points = points_of(self._ros, trajectory)
        joints = list(trajectory.joint_names)
        check(self._name, joints, points)
        return self._player.follow(joints, points, now)

    def _end(self, goal: Goal, run: Run, aim: Point) -> None:
        if run.phase is not Phase.DONE:
            goal.cancel(run.phase.value)
        elif late := missed(run.joints, aim, self._player.positions):
            text = f"these joints missed the goal: {', '.join(late)}"
            goal.abort(text, error_code=int(ErrorCode.GOAL_TOLERANCE_VIOLATED), error_string=text)
        else:
            goal.succeed(error_code=int(ErrorCode.SUCCESSFUL))


def points_of(ros: RosSide, trajectory: Any) -> list[Point]:
    """Return the points of a trajectory_msgs/JointTrajectory."""
    return [Point(list(point.positions), ros.seconds(point.time_from_start)) for point in trajectory.points]
