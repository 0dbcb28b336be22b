"""The node of a bridge in a process of its own, with a core that prints what it gets.

Each line of stdin is a command: a velocity to publish, or `cancel`.
"""

import asyncio
import sys
import time

from robots.bridge.ros2.node import RosBase
from robots.shared.configuration.bridge_config import ScanSource, Topic, Topics
from robots.shared.geometry.poses import Velocity

DOMAIN = int(sys.argv[1])
TOPICS = Topics(
    drive=Topic("/key_vel", "geometry_msgs/Twist"),
    odometry=Topic("/mobile_base_controller/odom", "nav_msgs/Odometry"),
    scans=[ScanSource("/scan_raw", (0.2, 0.0, 0.0))],
    cancel_on_stop=["/play_motion2", "/nobody"],
)


class Core:
    needs_fresh_sensors = True

    def odometry(self, stamp_s, arrival_s, pose, velocity, wall_s, run):
        tell("odometry", *pose, *velocity, run, abs(stamp_s - wall_s) < 1.0)

    def laser(self, scan):
        tell("scan", scan.source, *scan.ranges, scan.angle_min, scan.range_max_m)


def tell(*words):
    print(*words, flush=True)


async def main():
    loop = asyncio.get_running_loop()
    base = RosBase(TOPICS, DOMAIN)
    base.start(loop, Core(), lambda call: call())
    while not base.listeners:  # noqa: ASYNC110  (DDS tells nobody)
        await asyncio.sleep(0.02)
    tell("listened")
    while line := await loop.run_in_executor(None, sys.stdin.readline):
        match line.split():
            case ["cancel"]:
                base.cancel_all()
            case [x, w]:
                base.publish(Velocity(float(x), 0.0, float(w)))
    began_s = time.monotonic()
    base.stop()
    tell("left", time.monotonic() - began_s < 2.0)


asyncio.run(main())
