"""The /move_base action and its topics: the plan, simple goals, and navigation's velocity."""

from __future__ import annotations

from typing import Any

import rospy
from geometry_msgs.msg import PoseStamped
from move_base_msgs.msg import MoveBaseActionGoal, MoveBaseActionResult

from robots.simulator.actions.navigation import NavigationServer
from robots.simulator.navigation.navigator import GoalDrive, Phase
from robots.simulator.robot import Robot
from robots.simulator.ros_side import Goal, RosSide
from robots.simulator.topics.velocities import Velocities


class MoveBaseServer(NavigationServer):
    """move_base."""

    def __init__(self, ros: RosSide, robot: Robot) -> None:
        self._stray = rospy.Publisher("/move_base/result", MoveBaseActionResult, queue_size=1)
        goal = rospy.Publisher("/move_base/goal", MoveBaseActionGoal, queue_size=1)
        rospy.Subscriber(
            "/move_base_simple/goal", PoseStamped, lambda pose: goal.publish(_simple(pose)), queue_size=1
        )
        goals = ros.goals("/move_base", "move_base_msgs/MoveBase")
        super().__init__(ros, robot, goals, "/nav_vel", "/move_base/GlobalPlanner/plan", Velocities(ros))

    def _target(self, request: Any) -> Any:
        return request.target_pose

    def _tell(self, goal: Goal, drive: GoalDrive, now: float) -> None:
        goal.feedback(base_position=self._believed())

    def _answer_another(self, goal: Any, drive: GoalDrive) -> None:
        result = MoveBaseActionResult()
        result.status.goal_id.id = goal.handle.get_goal_id().id + "-another"
        result.status.status = 3 if drive.phase is Phase.REACHED else 4
        result.status.text = drive.text
        self._stray.publish(result)


def _simple(pose: PoseStamped) -> MoveBaseActionGoal:
    goal = MoveBaseActionGoal()
    goal.header.stamp = goal.goal_id.stamp = rospy.Time.now()
    goal.goal.target_pose = pose
    return goal
