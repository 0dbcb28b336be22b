"""The action of navigation, its plan, and its velocity."""

from __future__ import annotations

import math
from typing import Any

from robots.simulator.navigation.navigator import REACHED, GoalDrive, Navigator, Phase
from robots.simulator.physics.base import Twist
from robots.simulator.physics.mujoco_world import Pose
from robots.simulator.robot import Robot
from robots.simulator.ros_side import Goal, Goals, RosSide
from robots.simulator.topics.messages import pose_of, yaw_quaternion
from robots.simulator.topics.velocities import Velocities

FEEDBACK_S = 0.2
PAUSES_S = 4.0  # with the fault `navigation_pauses`
# actionlib's text
REPLACED = "This goal was canceled because another goal was recieved by the simple action server"
INVALID = "Aborting on the goal because it was sent with an invalid quaternion"
ELSEWHERE = "The goal is not in the frame of the map"


class NavigationServer:
    """Takes goals in the frame of the map and drives to them by topic `velocity`. A new goal replaces the running one.

    `ros` and `ros2` have the fields of goal and feedback.
    """

    def __init__(
        self, ros: RosSide, robot: Robot, goals: Goals, velocity: str, plan: str, velocities: Velocities
    ) -> None:
        self._ros = ros
        self._robot = robot
        self._goals = goals
        self._navigator = Navigator(robot)
        self._running: tuple[Goal, GoalDrive] | None = None
        self._plan_sent: list[tuple[float, float]] = []
        self._feedback_s = 0.0
        self._had_goal_s = -math.inf
        self._velocities = velocities
        self._velocity = ros.publisher(velocity, velocities.kind)
        self._plan = ros.publisher(plan, "nav_msgs/Path", kept=True)

    def step(self, now: float) -> None:
        """Take goals and cancels, drive on, and report."""
        for is_new, goal in self._goals.arrived():
            if is_new:
                self._begin(goal, now)
            elif self._running is not None and goal == self._running[0]:
                self._cancel(goal, "")
            elif not self._robot.faults.navigation_silent:  # a goal that is not running any more
                goal.cancel("")
        if self._running is None and self._navigator.drive and not self._goes_on:
            self._navigator.cancel()  # the fault is over: a robot without a goal stands
            self._drive(Twist())
        if self._running is not None:
            self._had_goal_s = now
        rests = self._robot.faults.navigation_pauses and 0.0 < now - self._had_goal_s < PAUSES_S
        twist = None if rests else self._navigator.step(now)
        if twist is not None:
            self._drive(twist)
        if self._running is not None:
            self._report(*self._running, now)

    def _target(self, request: Any) -> Any:
        """Return the pose of a goal, a geometry_msgs/PoseStamped."""
        raise NotImplementedError

    def _tell(self, goal: Goal, drive: GoalDrive, now: float) -> None:
        """Publish feedback."""
        raise NotImplementedError

    def _answer_another(self, goal: Goal, drive: GoalDrive) -> None:
        """Publish a result for a goal that nobody sent, where that can be; this goal has none."""

    @property
    def _goes_on(self) -> bool:
        return self._robot.faults.navigation_goes_on or self._robot.faults.navigation_pauses

    def _begin(self, goal: Goal, now: float) -> None:
        if self._robot.faults.navigation_silent:
            goal.ignore()
            return
        if self._running is not None:
            self._cancel(self._running[0], REPLACED)
        goal.accept()
        target = self._target(goal.request)
        pose = pose_of(target.pose)
        if pose is None or target.header.frame_id.lstrip("/") != "map":
            goal.abort(INVALID if pose is None else ELSEWHERE)
            return
        self._running = goal, self._navigator.go(pose, now)

    def _cancel(self, goal: Goal, text: str) -> None:
        """End the running goal. With some faults the robot still drives on."""
        self._running = None
        goal.cancel(text)
        if not self._goes_on:
            self._navigator.cancel()
            self._drive(Twist())

    def _report(self, goal: Goal, drive: GoalDrive, now: float) -> None:
        if drive.path != self._plan_sent:
            self._plan_sent = list(drive.path)
            self._plan.publish(self._path(drive.path))
        if drive.phase is Phase.DRIVING:
            if now - self._feedback_s >= FEEDBACK_S:
                self._feedback_s = now
                self._tell(goal, drive, now)
            return
        self._running = None
        self._navigator.cancel()
        if self._robot.faults.navigation_answers_another:
            self._answer_another(goal, drive)
        elif drive.phase is Phase.REACHED:
            goal.succeed(REACHED)
        else:
            goal.abort(drive.text)

    def _believed(self) -> Any:
        """Return where the robot believes to be, as a geometry_msgs/PoseStamped."""
        position = self._ros.stamped(self._ros.new("geometry_msgs/PoseStamped"), self._ros.now(), "map")
        pose = self._robot.believed() or Pose(0.0, 0.0, 0.0)
        position.pose.position.x, position.pose.position.y = pose.x, pose.y
        position.pose.orientation = yaw_quaternion(self._ros, pose.yaw)
        return position

    def _drive(self, twist: Twist) -> None:
        self._velocity.publish(self._velocities.message(twist))

    def _path(self, places: list[tuple[float, float]]) -> Any:
        path = self._ros.stamped(self._ros.new("nav_msgs/Path"), self._ros.now(), "map")
        poses = []
        for x, y in places:
            pose = self._ros.new("geometry_msgs/PoseStamped", header=path.header)
            pose.pose.position.x, pose.pose.position.y, pose.pose.orientation.w = x, y, 1.0
            poses.append(pose)
        path.poses = poses
        return path
