"""The topics /tf and /tf_static: poses of the robot's frames."""

from __future__ import annotations

from functools import partial

import rospy

from robots.bridge.ros.on_demand_topics import listen
from robots.bridge.ros.sensors.frames import MAP, ODOM, Frames
from robots.shared.geometry.poses import Pose


class TfTopics:
    """Poses of frames in `base`, and of the odometry frame in the map frame."""

    def __init__(self, base: str = MAP) -> None:
        self.frames = Frames(base)

    def listen(self) -> list[rospy.Subscriber]:
        """Subscribe."""
        topics = {"/tf_static": True, "/tf": False}
        return [
            listen(name, "tf2_msgs/TFMessage", partial(self.frames.read, fixed=fixed))
            for name, fixed in topics.items()
        ]

    def forget(self) -> None:
        """Forget all transforms: they may be outdated."""
        self.frames.forget()

    def located(self) -> tuple[float, Pose] | None:
        """Return the stamp and the last pose of the odometry frame in the map frame, if any."""
        return self.frames.flat(ODOM, MAP)
