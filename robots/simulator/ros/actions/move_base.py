"""The /move_base action and its topics: the plan, simple goals, and navigation's velocity."""

from __future__ import annotations

import math
from typing import Any

import rospy
from geometry_msgs.msg import PoseStamped, Twist
from move_base_msgs.msg import MoveBaseActionGoal, MoveBaseActionResult, MoveBaseFeedback, MoveBaseResult
from nav_msgs.msg import Path

from robots.simulator.navigation.navigator import REACHED, GoalDrive, Navigator, Phase
from robots.simulator.physics.base import Twist as BaseTwist
from robots.simulator.physics.mujoco_world import Pose
from robots.simulator.robot import Robot
from robots.simulator.ros.actions.action_server import Goals
from robots.simulator.ros.map import pose_of
from robots.simulator.ros.messages import stamped, yaw_quaternion

FEEDBACK_S = 0.2
PAUSES_S = 4.0  # with the fault `navigation_pauses`
# actionlib's text
REPLACED = "This goal was canceled because another goal was recieved by the simple action server"
INVALID = "Aborting on the goal because it was sent with an invalid quaternion"
ELSEWHERE = "The goal is not in the frame of the map"


class MoveBaseServer:
    """Takes goals in the frame of the map and drives to them through `nav_vel`. A new goal replaces the running one."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._navigator = Navigator(robot)
        self._running: tuple[Any, GoalDrive] | None = None  # handle and drive
        self._plan_sent: list[tuple[float, float]] = []
        self._feedback_s = 0.0
        self._had_goal_s = -math.inf
        self._velocity = rospy.Publisher("/nav_vel", Twist, queue_size=1, tcp_nodelay=True)
        self._plan = rospy.Publisher("/move_base/GlobalPlanner/plan", Path, queue_size=1, latch=True)
        self._stray = rospy.Publisher("/move_base/result", MoveBaseActionResult, queue_size=1)
        goal = rospy.Publisher("/move_base/goal", MoveBaseActionGoal, queue_size=1)
        rospy.Subscriber(
            "/move_base_simple/goal", PoseStamped, lambda pose: goal.publish(_simple(pose)), queue_size=1
        )
        self._goals = Goals("/move_base", "move_base_msgs/MoveBaseAction")

    def step(self, now: float) -> None:
        """Take goals and cancels, drive on, and report."""
        for is_goal, handle in self._goals.arrived():
            if is_goal:
                self._begin(handle, now)
            elif self._running is not None and handle == self._running[0]:
                self._cancel(handle, "")
            elif not self._robot.faults.navigation_silent:  # a goal that is not running any more
                handle.set_canceled(MoveBaseResult(), "")
        if self._running is None and self._navigator.drive and not self._goes_on:
            self._navigator.cancel()  # the fault is over: a robot without a goal stands
            self._drive(BaseTwist())
        if self._running is not None:
            self._had_goal_s = now
        rests = self._robot.faults.navigation_pauses and 0.0 < now - self._had_goal_s < PAUSES_S
        twist = None if rests else self._navigator.step(now)
        if twist is not None:
            self._drive(twist)
        if self._running is not None:
            self._report(*self._running, now)

    @property
    def _goes_on(self) -> bool:
        return self._robot.faults.navigation_goes_on or self._robot.faults.navigation_pauses

    def _begin(self, handle: Any, now: float) -> None:
        if self._robot.faults.navigation_silent:
            return
        if self._running is not None:
            self._cancel(self._running[0], REPLACED)
        handle.set_accepted()
        target = handle.get_goal().target_pose
        goal = pose_of(target.pose)
        if goal is None or target.header.frame_id.lstrip("/") != "map":
            text = INVALID if goal is None else ELSEWHERE
            handle.set_aborted(MoveBaseResult(), text)
            return
        self._running = handle, self._navigator.go(goal, now)

    def _cancel(self, handle: Any, text: str) -> None:
        """End the running goal. With some faults the robot still drives on."""
        self._running = None
        handle.set_canceled(MoveBaseResult(), text)
        if not self._goes_on:
            self._navigator.cancel()
            self._drive(BaseTwist())

    def _report(self, handle: Any, drive: GoalDrive, now: float) -> None:
        if drive.path != self._plan_sent:
            self._plan_sent = list(drive.path)
            self._plan.publish(_path(drive.path))
        if drive.phase is Phase.DRIVING:
            if now - self._feedback_s >= FEEDBACK_S:
                self._feedback_s = now
                handle.publish_feedback(MoveBaseFeedback(base_position=self._base_position()))
            return
        self._running = None
        self._navigator.cancel()
        if self._robot.faults.navigation_answers_another:
            self._answer_another(handle, drive)
        elif drive.phase is Phase.REACHED:
            handle.set_succeeded(MoveBaseResult(), REACHED)
        else:
            handle.set_aborted(MoveBaseResult(), drive.text)

    def _answer_another(self, handle: Any, drive: GoalDrive) -> None:
        """Publish a result for a goal that nobody sent."""
        result = MoveBaseActionResult()
        result.status.goal_id.id = handle.get_goal_id().id + "-another"
        result.status.status = 3 if drive.phase is Phase.REACHED else 4
        result.status.text = drive.text
        self._stray.publish(result)

    def _base_position(self) -> PoseStamped:
        position = stamped(PoseStamped(), rospy.Time.now(), "map")
        pose = self._robot.believed() or Pose(0.0, 0.0, 0.0)
        position.pose.position.x, position.pose.position.y = pose.x, pose.y
        position.pose.orientation = yaw_quaternion(pose.yaw)
        return position

    def _drive(self, twist: BaseTwist) -> None:
        message = Twist()
        message.linear.x, message.angular.z = twist.vx, twist.w
        self._velocity.publish(message)


def _simple(pose: PoseStamped) -> MoveBaseActionGoal:
    goal = MoveBaseActionGoal()
    goal.header.stamp = goal.goal_id.stamp = rospy.Time.now()
    goal.goal.target_pose = pose
    return goal


def _path(places: list[tuple[float, float]]) -> Path:
    path = stamped(Path(), rospy.Time.now(), "map")
    for x, y in places:
        pose = PoseStamped(header=path.header)
        pose.pose.position.x, pose.pose.position.y, pose.pose.orientation.w = x, y, 1.0
        path.poses.append(pose)
    return path
