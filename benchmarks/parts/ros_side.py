"""The robot's side of a benchmark: a rospy process independent of the console.

Run by the distribution's Python, on the master in ROS_MASTER_URI:

    ros_side.py observe [odometry] [scan] [goals] [truth]
                                     a line for each message: kind, arrival (monotonic ns), values; each line of stdin
                                     is a fault for the simulated robot
    ros_side.py publish              Twists at 50 Hz to /bench_bare, each with its time of sending
    ros_side.py map                  a map of 1000 x 1000 cells to /map, once a second
    ros_side.py watch_map            reads the bytes of this map, as a display does
    ros_side.py many                 500 topics without messages
    ros_side.py watch_camera         subscribes to the head camera, so that it takes pictures all the time
    ros_side.py laser                scans of 666 beams to /bench_laser, 15 a second
    ros_side.py grid                 a map of 1000 x 1000 cells to /bench_grid, once a second
    ros_side.py picture              a raw picture of 640 x 480 to /bench_picture, 30 a second
    ros_side.py picture_20           the same, 20 a second
    ros_side.py jpeg                 60 kB as a JPEG has them to /bench_jpeg, 30 a second
    ros_side.py tiny                 headers to /bench_tiny, 10,000 a second

The last six have the time of sending (monotonic) as their stamp.
"""

from __future__ import annotations

import random
import signal
import sys
import threading
import time
from typing import Any

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import OccupancyGrid, Odometry
from sensor_msgs.msg import CompressedImage, Image, LaserScan
from std_msgs.msg import Header, String

DRIVE_TOPIC = "/key_vel"
BARE_TOPIC = "/bench_bare"
RATE_HZ = 50.0
CAMERA_TOPIC = "/xtion/rgb/image_raw/compressed"
MANY = 500
RANDOM = random.Random(0)  # noqa: S311 - contents of messages, no secrets


def say(line: str) -> None:
    """Write one line at once."""
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def observe(*also: str) -> None:
    """Print commands, and on request odometry, true motion, scans and goals."""

    def on_command(message: Twist) -> None:
        now_ns = time.monotonic_ns()
        say(f"command {now_ns} {message.linear.x!r} {message.linear.y!r} {message.angular.z!r}")

    def on_bare(message: Twist) -> None:
        say(f"bare {time.monotonic_ns()} {message.linear.z!r}")

    def on_odometry(message: Odometry) -> None:
        now_ns = time.monotonic_ns()
        twist = message.twist.twist
        say(f"odometry {now_ns} {twist.linear.x!r} {twist.linear.y!r} {twist.angular.z!r}")

    def on_truth(message: Odometry) -> None:
        now_ns = time.monotonic_ns()
        twist = message.twist.twist
        say(f"truth {now_ns} {twist.linear.x!r} {twist.linear.y!r} {twist.angular.z!r}")

    def on_scan(message: LaserScan) -> None:
        say(f"scan {time.monotonic_ns()} {message.header.seq}")

    rospy.Subscriber(DRIVE_TOPIC, Twist, on_command, tcp_nodelay=True)
    rospy.Subscriber(BARE_TOPIC, Twist, on_bare, tcp_nodelay=True)
    if "odometry" in also:
        rospy.Subscriber("/mobile_base_controller/odom", Odometry, on_odometry, tcp_nodelay=True)
    if "truth" in also:
        rospy.Subscriber("/ground_truth/pose", Odometry, on_truth, tcp_nodelay=True)
    if "scan" in also:
        rospy.Subscriber("/scan_raw", LaserScan, on_scan, tcp_nodelay=True)
    if "goals" in also:
        rospy.Subscriber("/play_motion/goal", rospy.AnyMsg, lambda _: say(f"goal {time.monotonic_ns()}"))
    threading.Thread(target=pass_on_faults, daemon=True).start()
    say("ready")
    rospy.spin()


def pass_on_faults() -> None:
    publisher = rospy.Publisher("/ground_truth/fault", String, queue_size=5, tcp_nodelay=True)
    for line in sys.stdin:
        publisher.publish(String(line.strip()))


def publish() -> None:
    """Publish with rospy only: the same message at the same rate, without the console."""
    publisher = rospy.Publisher(BARE_TOPIC, Twist, queue_size=1, tcp_nodelay=True)
    message = Twist()
    due_s = time.monotonic()
    while not rospy.is_shutdown():
        message.linear.z = time.monotonic()
        publisher.publish(message)
        # After a pause (SIGSTOP) missed messages are not sent
        due_s = max(due_s + 1.0 / RATE_HZ, time.monotonic())
        time.sleep(max(0.0, due_s - time.monotonic()))


def publish_map() -> None:
    """Publish a large map once a second."""
    publisher = rospy.Publisher("/map", OccupancyGrid, queue_size=1)
    grid = OccupancyGrid()
    grid.info.width = grid.info.height = 1000
    grid.info.resolution = 0.05
    grid.data = bytes(1_000_000)
    rate = rospy.Rate(1.0)
    while not rospy.is_shutdown():
        grid.header.stamp = rospy.Time.now()
        publisher.publish(grid)
        rate.sleep()


def watch_map() -> None:
    """Subscribe to the map, so that its bytes are sent."""
    rospy.Subscriber("/map", rospy.AnyMsg, lambda _message: None)
    rospy.spin()


def publish_many() -> None:
    """Advertise many topics."""
    names = [f"/bench_many/topic_{number:03}" for number in range(MANY)]
    publishers = [rospy.Publisher(name, String, queue_size=1) for name in names]
    say(f"ready {len(publishers)}")
    rospy.spin()


def watch_camera() -> None:
    """Subscribe to the camera."""
    rospy.Subscriber(CAMERA_TOPIC, rospy.AnyMsg, lambda _message: None, tcp_nodelay=True)
    rospy.spin()


def repeat(topic: str, message: Any, rate_hz: float) -> None:
    """Publish a message with the time of sending as its stamp."""
    publisher = rospy.Publisher(topic, type(message), queue_size=2, tcp_nodelay=True)
    header = getattr(message, "header", message)
    due_s = time.monotonic()
    while not rospy.is_shutdown():
        header.stamp = rospy.Time(*divmod(time.monotonic_ns(), 1_000_000_000))
        publisher.publish(message)
        due_s = max(due_s + 1.0 / rate_hz, time.monotonic() - 0.1)
        time.sleep(max(0.0, due_s - time.monotonic()))


def laser() -> None:
    """Publish scans whose numbers have as many digits as those of a real laser."""
    beams = [RANDOM.uniform(0.1, 25.0) for _ in range(666)]
    repeat("/bench_laser", LaserScan(angle_min=-1.66, angle_increment=0.005, ranges=beams), 15.0)


def grid() -> None:
    """Publish a map."""
    message = OccupancyGrid(data=RANDOM.choices((-1, 0, 100), k=1_000_000))
    message.info.width = message.info.height = 1000
    repeat("/bench_grid", message, 1.0)


def picture(rate_hz: float = 30.0) -> None:
    """Publish raw pictures."""
    message = Image(height=480, width=640, encoding="rgb8", step=1920, data=RANDOM.randbytes(921_600))
    repeat("/bench_picture", message, rate_hz)


def jpeg() -> None:
    """Publish compressed pictures."""
    repeat("/bench_jpeg", CompressedImage(format="jpeg", data=RANDOM.randbytes(60_000)), 30.0)


def tiny() -> None:
    """Publish far more than anybody reads."""
    repeat("/bench_tiny", Header(frame_id="tiny"), 10_000.0)


def main() -> None:
    """Run the role of the first argument."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    role, *words = sys.argv[1:]
    rospy.init_node(f"bench_{role}", anonymous=True, disable_signals=True)
    roles = {
        "observe": observe,
        "publish": publish,
        "map": publish_map,
        "watch_map": watch_map,
        "many": publish_many,
        "watch_camera": watch_camera,
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
