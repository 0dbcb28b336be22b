"""The /navigate_to_pose action, and /goal_pose, by which RViz sends goals to it."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

from robots.simulator.actions.navigation import NavigationServer
from robots.simulator.navigation.navigator import GoalDrive
from robots.simulator.robot import Robot
from robots.simulator.ros2.side import RclpySide
from robots.simulator.ros_side import Goal
from robots.simulator.topics.velocities import Velocities


class NavigateToPoseServer(NavigationServer):
    """Nav2's bt_navigator."""

    def __init__(self, ros: RclpySide, robot: Robot, velocities: Velocities) -> None:
        node, action, kind = ros.add_node("bt_navigator"), "/navigate_to_pose", "nav2_msgs/NavigateToPose"
        super().__init__(ros, robot, ros.goals(action, kind, node), "/cmd_vel", "/plan", velocities)
        send = ros.sender(node, action, kind)
        ros.subscribe("/goal_pose", "geometry_msgs/PoseStamped", lambda pose: send(pose=pose), queue=1)

    def _target(self, request: Any) -> Any:
        return request.pose

    def _tell(self, goal: Goal, drive: GoalDrive, now: float) -> None:
        here = self._believed()
        at = here.pose.position
        left_m = math.fsum(math.dist(a, b) for a, b in pairwise([(at.x, at.y), *drive.path]))
        goal.feedback(current_pose=here, distance_remaining=left_m)
