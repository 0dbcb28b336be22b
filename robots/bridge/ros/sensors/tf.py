"""Where the robot's frames are, from /tf and /tf_static."""

from __future__ import annotations

from functools import partial

import rospy

from robots.bridge.gate.values import Pose
from robots.bridge.ros.on_demand_topics import listen
from robots.bridge.ros.sensors.frames import MAP, ODOM, Frames


class TfTopics:
    """The places of frames in `base`, and of the odometry's in the map's."""

    def __init__(self, base: str = MAP) -> None:
        self.frames = Frames(base)

    def listen(self) -> list[rospy.Subscriber]:
        """Subscribe."""
        topics = {"/tf_static": True, "/tf": False}
        return [
            listen(name, "tf2_msgs/TFMessage", partial(self.frames.hear, fixed=fixed))
            for name, fixed in topics.items()
        ]

    def forget(self) -> None:
        """Where things were they need not be."""
        self.frames.forget()

    def map_to_odom(self) -> Pose | None:
        """The last one received, if any."""
        return self.frames.flat(ODOM, MAP)
