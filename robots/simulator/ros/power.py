"""The battery's topics, once a second."""

from __future__ import annotations

import rospy
from std_msgs.msg import Bool, Float32

from robots.simulator.robot import Robot


class PowerTopics:
    """/power: level in percent, charging, docked, emergency button."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._level = rospy.Publisher("/power/battery_level", Float32, queue_size=1, latch=True)
        self._charging = rospy.Publisher("/power/is_charging", Bool, queue_size=1, latch=True)
        self._docked = rospy.Publisher("/power/is_docked", Bool, queue_size=1, latch=True)
        self._emergency = rospy.Publisher("/power/is_emergency", Bool, queue_size=1, latch=True)

    def publish(self, _stamp: rospy.Time) -> None:
        """Publish all four topics."""
        battery = self._robot.battery
        self._level.publish(Float32(battery.percent))
        self._charging.publish(Bool(battery.charging))
        self._docked.publish(Bool(battery.charging))
        self._emergency.publish(Bool(False))
