"""The robot's side of a benchmark: a process of rospy or rclpy, independent of the console.

`observer.ros_side` makes its command, with ROS 1 for the distribution's Python: ros_side LIBRARY ROLE. Roles:

    observe [odometry] [scan] [goals] [truth]
                         a line for each message: kind, arrival (monotonic ns), values; each line of stdin
                         is a fault for the simulated robot
    publish              Twists at 50 Hz to /bench_bare, each with its time of sending
    watch_bare           reads them too, as the robot reads those of the console
    map                  a map of 1000 x 1000 cells to /map, once a second
    watch_map            reads the bytes of this map, as a display does
    many                 500 topics without messages
    watch_camera         subscribes to the head camera, so that it takes pictures all the time
    laser                scans of 666 beams to /bench_laser, 15 a second
    grid                 a map of 1000 x 1000 cells to /bench_grid, once a second
    picture              a raw picture of 640 x 480 to /bench_picture, 30 a second
    picture_20           the same, 20 a second
    jpeg                 60 kB as a JPEG has them to /bench_jpeg, 30 a second
    tiny                 headers to /bench_tiny, 10,000 a second

The last six have the time of sending (monotonic) as their stamp.
"""

from __future__ import annotations

import random
import sys
import threading
import time
from importlib import import_module
from types import ModuleType
from typing import Any

DRIVE_TOPIC = "/key_vel"
BARE_TOPIC = "/bench_bare"
RATE_HZ = 50.0
CAMERA_TOPIC = "/xtion/rgb/image_raw/compressed"
MANY = 500
ros: ModuleType  # by_rospy or by_rclpy
RANDOM = random.Random(0)  # noqa: S311 - contents of messages, no secrets


def say(line: str) -> None:
    """Write one line at once."""
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def observe(*also: str) -> None:
    """Print commands, and on request odometry, true motion, scans and goals."""

    def on_command(message: Any) -> None:
        now_ns = time.monotonic_ns()
        say(f"command {now_ns} {message.linear.x!r} {message.linear.y!r} {message.angular.z!r}")

    def on_bare(message: Any) -> None:
        say(f"bare {time.monotonic_ns()} {message.linear.z!r}")

    def on_odometry(message: Any) -> None:
        now_ns = time.monotonic_ns()
        twist = message.twist.twist
        say(f"odometry {now_ns} {twist.linear.x!r} {twist.linear.y!r} {twist.angular.z!r}")

    def on_truth(message: Any) -> None:
        now_ns = time.monotonic_ns()
        twist = message.twist.twist
        say(f"truth {now_ns} {twist.linear.x!r} {twist.linear.y!r} {twist.angular.z!r}")

    def on_scan(_message: Any) -> None:
        say(f"scan {time.monotonic_ns()}")

    ros.subscribe(DRIVE_TOPIC, "geometry_msgs/Twist", on_command)
    ros.subscribe(BARE_TOPIC, "geometry_msgs/Twist", on_bare)
    if "odometry" in also:
        ros.subscribe("/mobile_base_controller/odom", "nav_msgs/Odometry", on_odometry)
    if "truth" in also:
        ros.subscribe("/ground_truth/pose", "nav_msgs/Odometry", on_truth)
    if "scan" in also:
        ros.subscribe("/scan_raw", "sensor_msgs/LaserScan", on_scan)
    if "goals" in also:  # of ROS 1: in ROS 2 a goal is a service
        goal = "play_motion_msgs/PlayMotionActionGoal"
        ros.subscribe("/play_motion/goal", goal, lambda _: say(f"goal {time.monotonic_ns()}"), raw=True)
    threading.Thread(target=pass_on_faults, daemon=True).start()
    say("ready")
    ros.spin()


def pass_on_faults() -> None:
    publisher = ros.publisher("/ground_truth/fault", "std_msgs/String", 5)
    fault = ros.message("std_msgs/String")
    for line in sys.stdin:
        while not ros.has_reader(publisher):  # before, it would be lost
            time.sleep(0.01)
        fault.data = line.strip()
        publisher.publish(fault)


def publish() -> None:
    """Publish with the client library only: the same message at the same rate, without the console."""
    publisher = ros.publisher(BARE_TOPIC, "geometry_msgs/Twist")
    message = ros.message("geometry_msgs/Twist")
    due_s = time.monotonic()
    while ros.running():
        message.linear.z = time.monotonic()
        publisher.publish(message)
        # After a pause (SIGSTOP) missed messages are not sent
        due_s = max(due_s + 1.0 / RATE_HZ, time.monotonic())
        time.sleep(max(0.0, due_s - time.monotonic()))


def publish_map() -> None:
    """Publish a large map once a second."""
    publisher = ros.publisher("/map", "nav_msgs/OccupancyGrid")
    grid = ros.message("nav_msgs/OccupancyGrid")
    grid.info.width = grid.info.height = 1000
    grid.info.resolution = 0.05
    grid.data = bytes(1_000_000)
    while ros.running():
        grid.header.stamp = ros.stamp(time.time_ns())
        publisher.publish(grid)
        time.sleep(1.0)


def watch(topic: str, kind: str) -> None:
    """Subscribe to a topic, so that its bytes are sent."""
    ros.subscribe(topic, kind, lambda _message: None, raw=True)
    ros.spin()


def publish_many() -> None:
    """Advertise many topics."""
    names = [f"/bench_many/topic_{number:03}" for number in range(MANY)]
    publishers = [ros.publisher(name, "std_msgs/String") for name in names]
    say(f"ready {len(publishers)}")
    ros.spin()


def repeat(topic: str, kind: str, rate_hz: float, **fields: Any) -> None:
    """Publish a message with the time of sending as its stamp."""
    publisher = ros.publisher(topic, kind, 2)
    message = ros.message(kind)
    for name, value in fields.items():
        setattr(message, name, value)
    header = getattr(message, "header", message)
    due_s = time.monotonic()
    while ros.running():
        header.stamp = ros.stamp(time.monotonic_ns())
        publisher.publish(message)
        due_s = max(due_s + 1.0 / rate_hz, time.monotonic() - 0.1)
        time.sleep(max(0.0, due_s - time.monotonic()))


def laser() -> None:
    """Publish scans whose numbers have as many digits as those of a real laser."""
    beams = [RANDOM.uniform(0.1, 25.0) for _ in range(666)]
    scan = {"angle_min": -1.66, "angle_increment": 0.005, "ranges": beams}
    repeat("/bench_laser", "sensor_msgs/LaserScan", 15.0, **scan)


def grid() -> None:
    """Publish a map."""
    info = ros.message("nav_msgs/MapMetaData")
    info.width = info.height = 1000
    cells = RANDOM.choices((-1, 0, 100), k=1_000_000)
    repeat("/bench_grid", "nav_msgs/OccupancyGrid", 1.0, info=info, data=cells)


def picture(rate_hz: float = 30.0) -> None:
    """Publish raw pictures."""
    pixels = ros.octets(RANDOM.randbytes(921_600))
    shape = {"height": 480, "width": 640, "encoding": "rgb8", "step": 1920}
    repeat("/bench_picture", "sensor_msgs/Image", rate_hz, **shape, data=pixels)


def jpeg() -> None:
    """Publish compressed pictures."""
    data = ros.octets(RANDOM.randbytes(60_000))
    repeat("/bench_jpeg", "sensor_msgs/CompressedImage", 30.0, format="jpeg", data=data)


def tiny() -> None:
    """Publish far more than anybody reads."""
    repeat("/bench_tiny", "std_msgs/Header", 10_000.0, frame_id="tiny")


def main() -> None:
    """Run the role of the second argument, with the library of the first."""
    global ros
    library, role, *words = sys.argv[1:]
    ros = import_module(f"benchmarks.parts.by_{library}")
    ros.join(f"bench_{role}")
    roles = {
        "observe": observe,
        "publish": publish,
        "map": publish_map,
        "watch_map": lambda: watch("/map", "nav_msgs/OccupancyGrid"),
        "watch_bare": lambda: watch(BARE_TOPIC, "geometry_msgs/Twist"),
        "many": publish_many,
        "watch_camera": lambda: watch(CAMERA_TOPIC, "sensor_msgs/CompressedImage"),
        "laser": laser,
        "grid": grid,
        "picture": picture,
        "picture_20": lambda: picture(20.0),
        "jpeg": jpeg,
        "tiny": tiny,
    }
    roles[role](*words)


if __name__ == "__main__":
    main()
