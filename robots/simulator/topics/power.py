"""The battery's topics, once a second."""

from __future__ import annotations

from robots.simulator.robot import Robot
from robots.simulator.ros_side import RosSide, Stamp


class PowerTopics:
    """/power: level in percent, charging, docked, emergency button."""

    def __init__(self, ros: RosSide, robot: Robot) -> None:
        self._ros = ros
        self._robot = robot
        self._level = ros.publisher("/power/battery_level", "std_msgs/Float32", kept=True)
        self._charging = ros.publisher("/power/is_charging", "std_msgs/Bool", kept=True)
        self._docked = ros.publisher("/power/is_docked", "std_msgs/Bool", kept=True)
        self._emergency = ros.publisher("/power/is_emergency", "std_msgs/Bool", kept=True)

    def publish(self, _stamp: Stamp) -> None:
        """Publish all four topics."""
        battery = self._robot.battery
        self._level.publish(self._ros.new("std_msgs/Float32", data=battery.percent))
        is_charging = self._ros.new("std_msgs/Bool", data=battery.charging)
        self._charging.publish(is_charging)
        self._docked.publish(is_charging)
        self._emergency.publish(self._ros.new("std_msgs/Bool", data=False))
