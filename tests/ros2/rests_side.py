"""A participant that rests: how many of eight messages that came during a rest are read before the next one."""

import robots.bridge.ros2  # noqa: F401, I001  (first: makes rclpy importable)

import os
import sys
import time

from std_msgs.msg import String

from robots.bridge.ros2.participant import Participant
from robots.bridge.ros2.qos import EVENTS

MESSAGES, ARRIVED_S = 8, 0.3


def main() -> None:
    heard: list[bytes] = []
    published = False

    def rest_s() -> float:
        nonlocal published
        if published:
            print("read", len(heard), flush=True)
            os._exit(0)
        if words.get_subscription_count():
            published = True
            for number in range(MESSAGES):
                words.publish(String(data=str(number)))
            time.sleep(ARRIVED_S)  # all have come, and the timers are due
        return 0.01

    participant = Participant("fleet_try", int(sys.argv[1]), rests=rest_s)
    words = participant.node.create_publisher(String, "/words", EVENTS)
    participant.listen("/words", "std_msgs/msg/String", lambda raw, info: heard.append(raw), EVENTS)
    for _ in range(3):
        participant.node.create_timer(ARRIVED_S, lambda: None)
    participant.start()
    time.sleep(20.0)


if __name__ == "__main__":
    main()
