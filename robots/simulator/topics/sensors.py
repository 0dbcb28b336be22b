"""The range sensors' topics."""

from __future__ import annotations

from array import array
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robots.simulator.robot import Robot
from robots.simulator.ros_side import NANO, RosSide, Stamp
from robots.simulator.sensors.sonar import Sonar

ULTRASOUND = 0  # radiation_type of sensor_msgs/Range


class LaserTopics:
    """The raw scan, and the scan as PAL filters it."""

    def __init__(self, ros: RosSide, robot: Robot) -> None:
        self._ros = ros
        self._robot = robot
        names = robot.body.names
        self._raw = ros.publisher(names.scan, "sensor_msgs/LaserScan", sensor=True)
        self._filtered = None
        if names.filtered_scan:
            self._filtered = ros.publisher(names.filtered_scan, "sensor_msgs/LaserScan", sensor=True)
        self._last: tuple[Stamp, NDArray[np.float32]] | None = None

    def publish(self, stamp: Stamp) -> None:
        """Scan once and publish on both topics."""
        faults = self._robot.faults
        if faults.laser_dead:
            return
        laser = self._robot.laser
        if self._last is None or not faults.laser_frozen:
            ahead = round(faults.laser_ahead_s * NANO)
            self._last = stamp + ahead, laser.scan(self._robot.physics)
        stamp, ranges = self._last
        if faults.laser_nan:
            ranges = np.full_like(ranges, np.nan)
        if self._raw.wanted:
            self._raw.publish(self._message(stamp, ranges))
        if self._filtered is not None and self._filtered.wanted:
            self._filtered.publish(self._message(stamp, laser.blanked(ranges)))

    def _message(self, stamp: Stamp, ranges: NDArray[np.float32]) -> Any:
        laser = self._robot.laser
        message = self._ros.new(
            "sensor_msgs/LaserScan",
            angle_min=-laser.mount.half_angle,
            angle_max=laser.mount.half_angle,
            angle_increment=laser.increment,
            scan_time=0.1,
            range_min=laser.mount.shortest_m,
            range_max=laser.mount.longest_m,
            ranges=array("f", ranges.astype(np.float32).tobytes()),
        )
        return self._ros.stamped(message, stamp, laser.mount.frame)


class SonarTopic:
    """All sonars on one topic, distinguished by their frames."""

    def __init__(self, ros: RosSide, robot: Robot) -> None:
        self._ros = ros
        self._robot = robot
        self._ranges = ros.publisher("/sonar_base", "sensor_msgs/Range", queue=5, sensor=True)

    def publish(self, sonar: Sonar, stamp: Stamp) -> None:
        """Measure with one sonar and publish the range."""
        if self._robot.faults.sonar_dead or not self._ranges.wanted:
            return
        mount = sonar.mount
        message = self._ros.new(
            "sensor_msgs/Range",
            radiation_type=ULTRASOUND,
            field_of_view=mount.fov,
            min_range=mount.shortest_m,
            max_range=mount.longest_m,
            range=sonar.range_m(self._robot.physics),
        )
        self._ranges.publish(self._ros.stamped(message, stamp, mount.frame))
