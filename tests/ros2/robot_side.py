"""A robot's base in a process of its own: odometry, scans, a listener of the drive topic, an action to cancel.

It prints one line for each twist and each cancel, and ends when stdin does.
"""

import robots.bridge.ros2  # noqa: F401, I001  (first: makes rclpy importable)

import os
import sys
import threading
from contextlib import suppress

import rclpy
from action_msgs.srv import CancelGoal
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import LaserScan


def main() -> None:
    rclpy.init()
    node = rclpy.create_node("base")
    odometry = node.create_publisher(Odometry, "/mobile_base_controller/odom", 10)
    scans = node.create_publisher(LaserScan, "/scan_raw", qos_profile_sensor_data)

    def tell(*words: object) -> None:
        print(*words, flush=True)

    def cancel(request: CancelGoal.Request, answer: CancelGoal.Response) -> CancelGoal.Response:
        zero = not any(request.goal_info.goal_id.uuid) and not request.goal_info.stamp.sec
        tell("cancel", "all" if zero else "one")
        return answer

    node.create_subscription(
        Twist, "/key_vel", lambda twist: tell("twist", twist.linear.x, twist.angular.z), 1
    )
    node.create_service(CancelGoal, "/play_motion2/_action/cancel_goal", cancel)

    def report() -> None:
        now = node.get_clock().now().to_msg()
        moved = Odometry(child_frame_id="base_footprint")
        moved.header.stamp, moved.header.frame_id = now, "odom"
        moved.pose.pose.position.x, moved.pose.pose.orientation.w = 1.5, 1.0
        moved.twist.twist.linear.x, moved.twist.twist.angular.z = 0.25, -0.5
        odometry.publish(moved)
        scan = LaserScan(angle_min=-1.0, angle_increment=0.5, range_min=0.05, range_max=10.0)
        scan.header.stamp, scan.header.frame_id = now, "laser"
        scan.ranges = [1.0, 2.0, float("inf"), 4.0, 5.0]
        scans.publish(scan)

    def spin() -> None:
        with suppress(ExternalShutdownException):
            rclpy.spin(node)

    node.create_timer(0.05, report)
    threading.Thread(target=spin, daemon=True).start()
    sys.stdin.read()
    os._exit(0)  # its threads never end


if __name__ == "__main__":
    main()
