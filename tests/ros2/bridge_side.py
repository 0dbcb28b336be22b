"""The node of a bridge in a process of its own, with a core that prints what it gets.

Each line of stdin is a command: a velocity to publish, or `cancel`.
"""

import asyncio
import sys
import time
import zlib
from unittest.mock import MagicMock

from msgspec import structs

from robots.bridge.ros2.node import RosBase
from robots.shared.configuration.bridge_config import ScanSource, SonarSource, Topic, Topics
from robots.shared.configuration.robot_ros import Discovery, Ros2
from robots.shared.geometry.poses import Velocity
from tests.bridge.support import CONFIG

DOMAIN = int(sys.argv[1])
TOPICS = Topics(
    drive=Topic("/key_vel", "geometry_msgs/msg/Twist"),
    odometry=Topic("/mobile_base_controller/odom", "nav_msgs/msg/Odometry"),
    scans=[ScanSource("/scan_raw", (0.2, 0.0, 0.0))],
    sonars=[SonarSource("/sonar_base", "sonar_1", (0.2, 0.0, 0.0), 0.5, 1.0)],
    battery=Topic("/power/battery_level", "std_msgs/msg/Float32"),
    diagnostics=Topic("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray"),
    joint_states=Topic("/joint_states", "sensor_msgs/msg/JointState"),
    cancel_on_stop=["/play_motion2", "/nobody"],
)
SEARCH: Discovery = "subnet" if "subnet" in sys.argv else "localhost"
CONFIG = structs.replace(CONFIG, ros=Ros2(DOMAIN, SEARCH), topics=TOPICS, state_dir=sys.argv[2])


class Core(MagicMock):
    needs_fresh_sensors, rests, clocks_agree = True, False, True

    def ros_status(self, status, now_s):
        tell("status", status.phase, "|", status.text, "|", *status.foreign, "|", *status.problems)

    def described(self, taken, ask_again):
        tell("described", len(zlib.decompress(taken.packed)))

    def restarted(self, now_s):
        tell("restarted")

    def odometry(self, stamp_s, arrival_s, pose, velocity, wall_s, run, messages):
        tell("odometry", *pose, *velocity, run, abs(stamp_s - wall_s) < 1.0)

    def range(self, frame_id, stamp_s, arrival_s, range_m):
        tell("range", frame_id, round(range_m, 3))

    def laser(self, scan, thins):
        tell("scan", scan.source, *scan.ranges, scan.angle_min, scan.range_max_m)


def tell(*words):
    print(*words, flush=True)


async def main():
    loop = asyncio.get_running_loop()
    core = Core()
    core.reports.battery = lambda percent, now_s: tell("battery", percent)
    core.reports.diagnostics.observe = lambda found, now_s: tell(
        "diagnostics", *(word for one in found for word in (one.name, one.level, one.node))
    )
    base = RosBase(CONFIG)
    base.start(loop, core, lambda call: call(), lambda taken: tell("lost", taken))
    while not base.listeners:  # noqa: ASYNC110  (DDS tells nobody)
        await asyncio.sleep(0.02)
    tell("listened")
    while line := await loop.run_in_executor(None, sys.stdin.readline):
        match line.split():
            case ["joints"]:
                tell("joints", base.joint("head_1_joint"), base.joint("torso"), base.joint("nose"))
            case ["cancel"]:
                base.cancel_all()
            case [x, w]:
                base.publish(Velocity(float(x), 0.0, float(w)))
    began_s = time.monotonic()
    base.stop()
    tell("left", time.monotonic() - began_s < 2.0)


asyncio.run(main())
