"""The robot's own navigation: its action's goals, its pose on the map, its path, and its twists."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import rospy

from robots.bridge.navigation.localisation import Spread
from robots.bridge.navigation.navigation_goals import NavigationGoals, Navigator
from robots.bridge.robot.interface import Node
from robots.bridge.robot.mailboxes import EVENTS_WAIT, Mailboxes
from robots.bridge.robot.parts import RobotPart
from robots.bridge.robot.sensors.poses import planar_pose
from robots.bridge.ros.tasks.actions import ActionTopics, GoalListener
from robots.bridge.ros.tasks.publishing import Sender
from robots.shared.configuration.bridge_config import NavigationSource, Topic
from robots.shared.geometry.poses import Pose, Velocity
from robots.shared.ros.message_types.classes import message_class

# Covariance of a pose that a person sets, as rviz sends it: 0.5 m, 15 degrees.
SET_M2, SET_RAD2 = 0.25, 0.0685
MOST_POINTS = 10_000  # of a path; a longer one is thinned before it is read
PLANS_S = 1.0  # between two paths that are taken; if more arrive in this time, the last is taken at its end


class NavigationTopics(Navigator, RobotPart, GoalListener):
    """The topics of one robot's navigation. Their messages go to `goals` through `mail`, on the event loop."""

    def __init__(
        self,
        source: NavigationSource,
        mail: Mailboxes,
        goals: NavigationGoals,
        located: Callable[[], tuple[float, Pose] | None],
    ) -> None:
        self._located = located
        self._frame = source.frame
        self._mail = mail
        self._goals = goals
        self._planned_s = -math.inf
        self._skipped: Any = None  # the last path that came too soon; a timer runs for it
        self._plans = threading.Lock()
        self._sent = 0  # number of goals: a path that was read before the last goal belongs to another goal
        self._action = ActionTopics(Topic(source.action, source.type), self)
        posed = message_class("geometry_msgs/PoseWithCovarianceStamped")
        self._set_pose = Sender(source.set_pose, posed) if source.set_pose else None
        self._posed = posed
        self._listen(source.velocity, "geometry_msgs/Twist", self._on_velocity)
        self._listen(source.pose, "geometry_msgs/PoseWithCovarianceStamped", self._on_pose)
        if source.plan:
            self._listen(source.plan, "nav_msgs/Path", self._on_plan)

    @classmethod
    def of(cls, node: Node) -> NavigationTopics | None:
        source = node.config.topics.navigation
        return cls(source, node.mail, node.tasks.navigation, node.located) if source else None

    def located(self) -> tuple[float, Pose] | None:
        return self._located()

    def navigates(self) -> bool:
        return self._action.heard

    def go(self, goal_id: str, goal: Pose) -> None:
        """Send a goal. Drop a waiting path: it belongs to an earlier goal."""
        with self._plans:
            self._planned_s, self._skipped = -math.inf, None
            self._sent += 1
        message = self._action.goal_class()
        message.goal_id.id = goal_id
        message.header.stamp = message.goal_id.stamp = rospy.Time.from_sec(time.time())
        target = message.goal.target_pose
        target.header.frame_id = self._frame
        _fill(target.pose, goal)
        self._action.send(message)

    def cancel_navigation(self, goal_id: str) -> None:
        self._action.cancel(goal_id)

    @property
    def cancels(self) -> list[Callable[[], None]]:
        return [self._action.cancel_all]

    def set_pose(self, pose: Pose) -> None:
        if self._set_pose is None:
            return
        message = self._posed()
        message.header.frame_id = self._frame
        message.header.stamp = rospy.Time.from_sec(time.time())
        _fill(message.pose.pose, pose)
        covariance = [0.0] * 36
        covariance[0] = covariance[7] = SET_M2
        covariance[35] = SET_RAD2
        message.pose.covariance = covariance
        self._set_pose.send(message)

    def _listen(self, topic: str, type_name: str, take: Callable[[Any], None]) -> None:
        rospy.Subscriber(topic, message_class(type_name), take, queue_size=1, tcp_nodelay=True)

    # --- on rospy's threads ---------------------------------------------------------------------------

    def running(self, action: str, goals: dict[str, int]) -> None:
        self._mail.post(
            "goals", lambda: self._goals.running(action, goals.keys(), time.monotonic()), can_wait=True
        )

    def feedback(self, goal_id: str, feedback: Any) -> None:
        self._mail.post(
            "goal feedback", lambda: self._goals.answered(goal_id, time.monotonic()), can_wait=True
        )

    def ended(self, goal_id: str, outcome: str, text: str, result: Any) -> None:
        self._mail.post(
            "goals ended", lambda: self._goals.ended(goal_id, outcome, text, time.monotonic()), EVENTS_WAIT
        )

    def _on_velocity(self, message: Any) -> None:
        velocity = Velocity(message.linear.x, message.linear.y, message.angular.z)
        self._mail.post(
            "navigation", lambda: self._goals.drove(velocity, time.monotonic()), EVENTS_WAIT, can_wait=True
        )

    def _on_pose(self, message: Any) -> None:
        pose, covariance = planar_pose(message.pose.pose), message.pose.covariance
        if message.header.frame_id.lstrip("/") != self._frame:
            return
        spread = Spread(covariance[0], covariance[1], covariance[7], covariance[35])
        place = self._goals.localisation
        self._mail.post("pose", lambda: place.posed(pose, spread, time.monotonic()), can_wait=True)

    def _on_plan(self, message: Any) -> None:
        if message.header.frame_id.lstrip("/") != self._frame:
            return
        with self._plans:
            waits_s = self._planned_s + PLANS_S - time.monotonic()
            if waits_s <= 0.0:
                self._take_plan(message)
                return
            waiting, self._skipped = self._skipped, message
        if waiting is None:
            timer = threading.Timer(waits_s, self._take_skipped)
            timer.daemon = True
            timer.start()

    def _take_skipped(self) -> None:
        with self._plans:
            if self._skipped is not None:
                self._take_plan(self._skipped)

    def _take_plan(self, message: Any) -> None:
        self._planned_s, self._skipped = time.monotonic(), None
        every = max(1, len(message.poses) // MOST_POINTS)
        poses = [*message.poses[::every], *message.poses[-1:]]
        points = np.array([(pose.pose.position.x, pose.pose.position.y) for pose in poses]).reshape(-1, 2)
        goals = self._sent

        def take() -> None:
            if goals == self._sent:
                self._goals.path.take(points)

        self._mail.post("plan", take, can_wait=True)


def _fill(message: Any, pose: Pose) -> None:
    message.position.x, message.position.y = pose.x, pose.y
    message.orientation.z, message.orientation.w = math.sin(pose.yaw / 2.0), math.cos(pose.yaw / 2.0)
