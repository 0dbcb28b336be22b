"""The range sensors' topics."""

from __future__ import annotations

from robots.bridge.ros import path  # noqa: F401  (first: makes rospy importable)

# isort: split
import numpy as np
import rospy
from numpy.typing import NDArray
from sensor_msgs.msg import LaserScan

from robots.simulator.robot import Robot


class LaserTopics:
    """/scan_raw, and /scan as PAL filters it."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._raw = rospy.Publisher("/scan_raw", LaserScan, queue_size=1, tcp_nodelay=True)
        self._filtered = rospy.Publisher("/scan", LaserScan, queue_size=1, tcp_nodelay=True)

    def publish(self, stamp: rospy.Time) -> None:
        """Scan once and tell both topics."""
        laser = self._robot.laser
        ranges = laser.scan(self._robot.physics)
        if self._raw.get_num_connections():
            self._raw.publish(self._message(stamp, ranges))
        if self._filtered.get_num_connections():
            self._filtered.publish(self._message(stamp, laser.blanked(ranges)))

    def _message(self, stamp: rospy.Time, ranges: NDArray[np.float32]) -> LaserScan:
        laser = self._robot.laser
        message = LaserScan(
            angle_min=-laser.mount.half_angle,
            angle_max=laser.mount.half_angle,
            angle_increment=laser.increment,
            scan_time=0.1,
            range_min=laser.mount.shortest_m,
            range_max=laser.mount.longest_m,
            ranges=ranges.tolist(),
        )
        message.header.stamp = stamp
        message.header.frame_id = laser.mount.frame
        return message
