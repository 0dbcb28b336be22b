"""A laser beside a robot, which sees nothing near. Each line of stdin says what it offers from then on:

sure, fast, kept: reliable, best effort, or with the last scan kept; newer: a version of its type with other fields.
It prints the line when the bridge has been connected with it for a while. It ends when stdin does.
"""

import robots.bridge.ros2  # noqa: F401, I001  (first: makes rclpy importable)

import os
import queue
import sys
import threading
import time

import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import LaserScan

from tests.ros2.crooked_robot import change_hash

TOPIC, FREE_M, BEAMS, EACH_S = "/scan_raw", 20.0, 381, 0.1
HEARD = 10  # scans: then none of before counts any more
OFFERS = {
    "sure": QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE),
    "fast": QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT),
    "kept": QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL),
}


def main() -> None:
    rclpy.init()
    node = rclpy.create_node("laser")
    lines: queue.SimpleQueue[str] = queue.SimpleQueue()

    def read() -> None:
        for line in sys.stdin:
            lines.put(line.strip())
        node.destroy_node()  # else others miss it only after 20 s
        os._exit(0)

    threading.Thread(target=read, daemon=True).start()
    reach = 1.66
    scan = LaserScan(
        angle_min=-reach,
        angle_max=reach,
        angle_increment=2.0 * reach / (BEAMS - 1),
        range_min=0.05,
        range_max=25.0,
    )
    scan.header.frame_id, scan.ranges = "base_laser_link", [FREE_M] * BEAMS
    while True:
        word = lines.get()
        if word == "newer":
            change_hash(LaserScan)
        publisher = node.create_publisher(LaserScan, TOPIC, OFFERS.get(word, OFFERS["fast"]))
        heard = 0
        while lines.empty():
            scan.header.stamp = node.get_clock().now().to_msg()
            publisher.publish(scan)
            heard += bool(publisher.get_subscription_count())
            if heard == HEARD:
                print(word, flush=True)
            time.sleep(EACH_S)
        node.destroy_publisher(publisher)


if __name__ == "__main__":
    main()
