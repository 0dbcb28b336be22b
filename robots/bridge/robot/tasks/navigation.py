"""Reports of the robot's own navigation: its goals, its pose on the map, its path, and its twists."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from robots.bridge.navigation.localisation import Spread
from robots.bridge.robot.incoming.mailboxes import EVENTS_WAIT
from robots.bridge.robot.interface import Node
from robots.bridge.robot.sensors.poses import planar_pose
from robots.shared.geometry.poses import Velocity

# Covariance of a pose that a person sets, as rviz sends it: 0.5 m, 15 degrees.
SET_M2, SET_RAD2 = 0.25, 0.0685
MOST_POINTS = 10_000  # of a path; a longer one is thinned before it is read
PLANS_S = 1.0  # between two paths that are taken; if more arrive in this time, the last is taken at its end


class NavigationReports:
    """Reports from the threads of the side to the tasks on the event loop. Poses and paths are those in `frame`."""

    def __init__(self, node: Node, frame: str) -> None:
        self._mail = node.mail
        self._goals = node.tasks.navigation
        self._frame = frame
        self._planned_s = -math.inf
        self._skipped: Any = None  # the last path that came too soon; a timer runs for it
        self._plans = threading.Lock()
        self._sent = 0  # number of goals: a path that was read before the last goal belongs to another goal

    def sends(self) -> None:
        """Drop a waiting path when a goal is sent: it belongs to an earlier goal."""
        with self._plans:
            self._planned_s, self._skipped = -math.inf, None
            self._sent += 1

    def running(self, action: str, goal_ids: Collection[str]) -> None:
        """Take the running goals of all senders."""
        self._mail.post(
            "goals", lambda: self._goals.running(action, goal_ids, time.monotonic()), can_wait=True
        )

    def answered(self, goal_id: str) -> None:
        """Take a sign of life of a goal."""
        self._mail.post(
            "goal feedback", lambda: self._goals.answered(goal_id, time.monotonic()), can_wait=True
        )

    def ended(self, goal_id: str, outcome: str, text: str) -> None:
        """Take the end of a goal, with the robot's text."""
        self._mail.post(
            "goals ended", lambda: self._goals.ended(goal_id, outcome, text, time.monotonic()), EVENTS_WAIT
        )

    def velocity(self, twist: Any) -> None:
        """Take a geometry_msgs/Twist of the navigation."""
        velocity = Velocity(twist.linear.x, twist.linear.y, twist.angular.z)
        self._mail.post(
            "navigation", lambda: self._goals.drove(velocity, time.monotonic()), EVENTS_WAIT, can_wait=True
        )

    def pose(self, message: Any) -> None:
        """Take a geometry_msgs/PoseWithCovarianceStamped."""
        pose, covariance = planar_pose(message.pose.pose), message.pose.covariance
        if message.header.frame_id.lstrip("/") != self._frame:
            return
        spread = Spread(covariance[0], covariance[1], covariance[7], covariance[35])
        place = self._goals.localisation
        self._mail.post("pose", lambda: place.posed(pose, spread, time.monotonic()), can_wait=True)

    def plan(self, message: Any) -> None:
        """Take a nav_msgs/Path."""
        if message.header.frame_id.lstrip("/") != self._frame:
            return
        with self._plans:
            waits_s = self._planned_s + PLANS_S - time.monotonic()
            if waits_s <= 0.0:
                self._take_plan(message.poses)
                return
            waiting, self._skipped = self._skipped, message.poses
        if waiting is None:
            timer = threading.Timer(waits_s, self._take_skipped)
            timer.daemon = True
            timer.start()

    def _take_skipped(self) -> None:
        with self._plans:
            if self._skipped is not None:
                self._take_plan(self._skipped)

    def _take_plan(self, path: Sequence[Any]) -> None:
        self._planned_s, self._skipped = time.monotonic(), None
        every = max(1, len(path) // MOST_POINTS)
        poses = [*path[::every], *path[-1:]]
        points = np.array([(pose.pose.position.x, pose.pose.position.y) for pose in poses]).reshape(-1, 2)
        goals = self._sent

        def take() -> None:
            if goals == self._sent:
                self._goals.path.take(points)

        self._mail.post("plan", take, can_wait=True)
