"""A robot's base in a process of its own: odometry, scans, a listener of the drive topic, actions to cancel.

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
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import JointState, LaserScan, Range
from std_msgs.msg import Float32, String

OTHER = "/arm_controller/follow_joint_trajectory"  # an action that no configuration names


def main() -> None:
    rclpy.init()
    node = rclpy.create_node("base")
    odometry = node.create_publisher(Odometry, "/mobile_base_controller/odom", 10)
    scans = node.create_publisher(LaserScan, "/scan_raw", qos_profile_sensor_data)

    sonars = node.create_publisher(Range, "/sonar_base", 10)
    battery = node.create_publisher(Float32, "/power/battery_level", 10)
    joints = node.create_publisher(JointState, "/joint_states", 10)
    diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", 10)

    description = node.create_publisher(
        String, "/robot_description", QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    )
    description.publish(String(data="<robot/>"))

    def tell(*words: object) -> None:
        print(*words, flush=True)

    def serve_cancel(action: str, word: str) -> None:
        def cancel(request: CancelGoal.Request, answer: CancelGoal.Response) -> CancelGoal.Response:
            goal, stamp = request.goal_info.goal_id, request.goal_info.stamp
            tell(word, "one" if any(goal.uuid) or stamp.sec or stamp.nanosec else "all")
            return answer

        node.create_service(CancelGoal, f"{action}/_action/cancel_goal", cancel)

    node.create_subscription(
        Twist, "/key_vel", lambda twist: tell("twist", twist.linear.x, twist.angular.z), 1
    )
    serve_cancel("/play_motion2", "cancel")
    serve_cancel(OTHER, "cancel_other")

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
        sonar = Range(range=0.75)
        sonar.header.frame_id = "sonar_1"
        sonars.publish(sonar)
        battery.publish(Float32(data=62.5))
        joints.publish(JointState(name=["head_1_joint", "torso"], position=[0.5, -0.25], velocity=[1.0, 2.0]))
        status = DiagnosticStatus(name="motor", level=DiagnosticStatus.WARN, message="hot")
        diagnostics.publish(DiagnosticArray(status=[status]))
        if node.count_clients(f"{OTHER}/_action/cancel_goal"):
            tell("found")

    def spin() -> None:
        with suppress(ExternalShutdownException):
            rclpy.spin(node)

    node.create_timer(0.05, report)
    spinning = threading.Thread(target=spin, daemon=True)
    spinning.start()
    sys.stdin.read()
    rclpy.shutdown()
    spinning.join()
    node.destroy_node()  # else others miss it only after 20 s
    os._exit(0)  # its threads never end


if __name__ == "__main__":
    main()
