"""A camera whose pictures nobody sends again: best effort, as those of most robots. Prints how many it published."""

import robots.bridge.ros2  # noqa: F401, I001  (first: makes rclpy importable)

import sys
import time
from array import array

from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Image

from robots.bridge.ros2.participant import Participant

WIDTH, HEIGHT, BYTES = 640, 480, 4  # 1.2 MB, in 19 datagrams
HZ = 10.0


def main() -> None:
    domain, topic, count = int(sys.argv[1]), sys.argv[2], int(sys.argv[3])
    participant = Participant("camera", domain)
    qos = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
    pictures = participant.node.create_publisher(Image, topic, qos)
    picture = Image(
        width=WIDTH,
        height=HEIGHT,
        encoding="32FC1",
        step=WIDTH * BYTES,
        data=array("B", bytes(WIDTH * HEIGHT * BYTES)),
    )
    while not pictures.get_subscription_count():
        time.sleep(0.05)
    for _ in range(count):
        pictures.publish(picture)
        time.sleep(1.0 / HZ)
    print("published", count, flush=True)
    sys.stdin.read()


if __name__ == "__main__":
    main()
