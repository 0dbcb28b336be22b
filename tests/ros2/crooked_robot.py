"""A robot with one fault of each kind that DDS lets live without a word. It ends when stdin does."""

import robots.bridge.ros2  # noqa: F401, I001  (first: makes rclpy importable)

import ctypes
import os
import sys
import threading
from typing import Any

import rclpy
from geometry_msgs.msg import PoseWithCovarianceStamped, Twist
from nav_msgs.msg import OccupancyGrid, Odometry
from play_motion2_msgs.action import PlayMotion2
from rclpy.action import ActionServer
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import BatteryState, LaserScan
from tf2_msgs.msg import TFMessage
from trajectory_msgs.msg import JointTrajectory

HASH_FUNCTION = 3  # of the fields of a rosidl_message_type_support_t, all pointers


class TypeHash(ctypes.Structure):
    """rosidl_type_hash_t"""

    _fields_ = (("version", ctypes.c_uint8), ("value", ctypes.c_uint8 * 32))


OTHER = TypeHash(1, (ctypes.c_uint8 * 32)(*range(32)))
GET_OTHER = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p)(lambda _: ctypes.addressof(OTHER))


def change_hash(kind: Any) -> None:
    """Let publishers of this type tell another version of it, as a package with other fields does."""
    kind.__class__.__import_type_support__()
    pointer = ctypes.pythonapi.PyCapsule_GetPointer
    pointer.restype, pointer.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
    name = ctypes.pythonapi.PyCapsule_GetName
    name.restype, name.argtypes = ctypes.c_char_p, [ctypes.py_object]
    capsule = kind.__class__._TYPE_SUPPORT
    fields = (ctypes.c_void_p * 4).from_address(pointer(capsule, name(capsule)))
    fields[HASH_FUNCTION] = ctypes.cast(GET_OTHER, ctypes.c_void_p).value


def main() -> None:
    rclpy.init()
    node, twin = rclpy.create_node("base"), rclpy.create_node("base")  # two robots with the same names
    odometry = [each.create_publisher(Odometry, "/mobile_base_controller/odom", 10) for each in (node, twin)]
    change_hash(LaserScan)
    node.create_publisher(LaserScan, "/scan_raw", qos_profile_sensor_data)
    node.create_publisher(BatteryState, "/joint_states", 10)
    node.create_publisher(OccupancyGrid, "/map", 1)
    frames = node.create_publisher(TFMessage, "/tf_static", 1)

    def listen(kind: Any, topic: str, **wanted: Any) -> None:
        node.create_subscription(kind, topic, lambda _: None, QoSProfile(depth=1, **wanted))

    listen(Twist, "/key_vel", deadline=Duration(seconds=0.5))
    listen(JointTrajectory, "/head_controller/joint_trajectory", durability=DurabilityPolicy.TRANSIENT_LOCAL)
    listen(PoseWithCovarianceStamped, "/initialpose", liveliness=LivelinessPolicy.MANUAL_BY_TOPIC)
    ActionServer(node, PlayMotion2, "/play_motion2", lambda goal: PlayMotion2.Result())
    bridges = [rclpy.create_node("fleet_bridge") for _ in range(2)]
    for each in bridges:
        each.create_publisher(Twist, "/key_vel", 1)

    def report() -> None:
        moved = Odometry()
        moved.header.stamp = node.get_clock().now().to_msg()
        for each in odometry:
            each.publish(moved)
        frames.publish(TFMessage())

    print("up", flush=True)
    ending = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), ending.set()), daemon=True).start()
    while not ending.wait(0.05):
        report()
    for each in (node, twin, *bridges):
        each.destroy_node()  # else others miss it only after 20 s
    os._exit(0)


if __name__ == "__main__":
    main()
