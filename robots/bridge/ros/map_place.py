"""Where the odometry's frame is in the map's, heard while somebody has control. For robots without a depth camera,
whose topics tell it too (`robots.bridge.ros.depth`).
"""

from __future__ import annotations

import rospy

from robots.bridge.gate.values import Pose
from robots.bridge.ros.errands import Errands
from robots.bridge.ros.frames import MAP, ODOM, Frames


class MapPlace:
    """Listens to tf, or leaves the robot alone."""

    def __init__(self, errands: Errands) -> None:
        self.subscribers: list[rospy.Subscriber] = []
        self._errands = errands
        self._frames = Frames(MAP)
        self._wanted = False

    def look(self, wanted: bool) -> None:
        """Whether to listen. Returns at once: subscribing asks the master."""
        if wanted != self._wanted:
            self._wanted = wanted
            self._errands.do(self._follow)

    def map_to_odom(self) -> Pose | None:
        """As it was told last."""
        return self._frames.flat(ODOM, MAP)

    def _follow(self) -> None:
        if self._wanted and not self.subscribers:
            self.subscribers = [
                rospy.Subscriber(topic, rospy.AnyMsg, lambda message, fixed=fixed: self._hear(message, fixed))
                for topic, fixed in (("/tf_static", True), ("/tf", False))
            ]
        elif not self._wanted and self.subscribers:
            leaving, self.subscribers = self.subscribers, []
            for subscriber in leaving:
                subscriber.unregister()
            self._frames = Frames(MAP)  # what was told before is not where things are

    def _hear(self, message: rospy.AnyMsg, fixed: bool) -> None:
        self._frames.hear(message._buff, fixed)
