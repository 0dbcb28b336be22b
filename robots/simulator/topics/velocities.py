"""Messages of velocities: geometry_msgs/Twist, or TwistStamped as later software has them."""

from __future__ import annotations

from typing import Any

from robots.simulator.physics.base import Twist
from robots.simulator.ros_side import RosSide

OLD_S = 0.25  # of a stamp: the base's controller, as PAL sets it, refuses what is older
NANO = 1e-9


class Velocities:
    """The velocities of one robot."""

    def __init__(self, ros: RosSide, *, stamped: bool = False) -> None:
        self._ros, self._stamped = ros, stamped
        self.kind = "geometry_msgs/TwistStamped" if stamped else "geometry_msgs/Twist"

    def message(self, velocity: Twist) -> Any:
        """Return the message of a velocity."""
        twist = self._ros.new("geometry_msgs/Twist")
        twist.linear.x, twist.angular.z = velocity.vx, velocity.w
        if not self._stamped:
            return twist
        return self._ros.stamped(self._ros.new(self.kind, twist=twist), self._ros.now())

    def read(self, message: Any, ahead_s: float = 0.0) -> Twist | None:
        """Return the velocity of a message; None: by a clock that is so much ahead, its stamp is too old.

        As for ros2_control, a stamp of zero is the present time.
        """
        twist = message
        if self._stamped:
            twist = message.twist
            stamp_s = self._ros.seconds(message.header.stamp)
            if stamp_s and self._ros.now() * NANO + ahead_s - stamp_s > OLD_S:
                return None
        return Twist(twist.linear.x, twist.linear.y, twist.angular.z)
