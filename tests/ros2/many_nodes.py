"""`robot NUMBER`: so many participants in ROS_DOMAIN_ID; `console NUMBER`: wait until so many of them are found."""

import robots.bridge.ros2  # noqa: F401, I001  (first: makes rclpy importable)

import os
import sys
import time

from robots.bridge.ros2.participant import Participant


def main() -> None:
    what, number, domain = sys.argv[1], int(sys.argv[2]), int(os.environ["ROS_DOMAIN_ID"])
    if what == "robot":
        kept = [Participant(f"node_{each}", domain) for each in range(number)]
        print("up", len(kept), flush=True)
        sys.stdin.read()
        os._exit(0)
    looking = Participant("fleet_look", domain)
    while len({name for name in looking.node.get_node_names() if name.startswith("node_")}) < number:
        time.sleep(0.05)  # DDS tells nobody
    print("found", number, flush=True)
    os._exit(0)


main()
