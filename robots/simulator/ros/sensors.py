"""The range sensors' topics."""

from __future__ import annotations

import numpy as np
import rospy
from numpy.typing import NDArray
from sensor_msgs.msg import LaserScan, Range

from robots.simulator.robot import Robot
from robots.simulator.ros.messages import stamped
from robots.simulator.sensors.sonar import Sonar


class LaserTopics:
    """The raw scan, and the scan as PAL filters it."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        names = robot.body.names
        self._raw = rospy.Publisher(names.scan, LaserScan, queue_size=1, tcp_nodelay=True)
        self._filtered = None
        if names.filtered_scan:
            self._filtered = rospy.Publisher(names.filtered_scan, LaserScan, queue_size=1, tcp_nodelay=True)
        self._last: tuple[rospy.Time, NDArray[np.float32]] | None = None

    def publish(self, stamp: rospy.Time) -> None:
        """Scan once and publish on both topics."""
        faults = self._robot.faults
        if faults.laser_dead:
            return
        laser = self._robot.laser
        if self._last is None or not faults.laser_frozen:
            self._last = stamp, laser.scan(self._robot.physics)
        stamp, ranges = self._last
        if faults.laser_nan:
            ranges = np.full_like(ranges, np.nan)
        if self._raw.get_num_connections():
            self._raw.publish(self._message(stamp, ranges))
        if self._filtered is not None and self._filtered.get_num_connections():
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
        return stamped(message, stamp, laser.mount.frame)


class SonarTopic:
    """All sonars on one topic, distinguished by their frames."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._ranges = rospy.Publisher("/sonar_base", Range, queue_size=5, tcp_nodelay=True)

    def publish(self, sonar: Sonar, stamp: rospy.Time) -> None:
        """Measure with one sonar and publish the range."""
        if self._robot.faults.sonar_dead or not self._ranges.get_num_connections():
            return
        mount = sonar.mount
        message = Range(
            radiation_type=Range.ULTRASOUND,
            field_of_view=mount.fov,
            min_range=mount.shortest_m,
            max_range=mount.longest_m,
            range=sonar.range_m(self._robot.physics),
        )
        self._ranges.publish(stamped(message, stamp, mount.frame))
