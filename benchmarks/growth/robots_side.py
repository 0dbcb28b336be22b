"""Light stand-ins for robots: `python -m benchmarks.growth.robots_side PORT ...`, a ROS master at each port.

Each robot is a process that reports odometry ten times a second and listens to its drive topic: enough to be online.
"""

from __future__ import annotations

import os
import sys
import time

import robots.shared.ros  # noqa: F401  # makes ROS importable, so it comes first

# isort: split
import rosgraph
import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rosmaster.master import Master

ODOMETRY_HZ = 10.0


def robot(port: int) -> None:
    """Run one robot until the process of the masters ends."""
    masters = os.getppid()
    os.environ["ROS_MASTER_URI"] = f"http://127.0.0.1:{port}"
    while not rosgraph.is_master_online():
        time.sleep(0.2)
    rospy.init_node("robot", disable_signals=True, disable_rosout=True)
    odometry = rospy.Publisher("/mobile_base_controller/odom", Odometry, queue_size=1)
    rospy.Subscriber("/key_vel", Twist, lambda _twist: None)
    message = Odometry()
    message.header.frame_id, message.child_frame_id = "odom", "base_footprint"
    message.pose.pose.orientation.w = 1.0
    while os.getppid() == masters:
        message.header.stamp = rospy.Time.now()
        odometry.publish(message)
        time.sleep(1.0 / ODOMETRY_HZ)


def main() -> None:
    """Start robots, then their masters: a process with threads must not fork."""
    ports = list(map(int, sys.argv[1:]))
    for port in ports:
        if os.fork() == 0:
            robot(port)
            os._exit(0)
    for port in ports:
        Master(port, 3).start()
    print("ready", flush=True)
    while True:
        time.sleep(60.0)


if __name__ == "__main__":
    main()
