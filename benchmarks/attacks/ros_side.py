"""Attackers on a robot's network: ``python -m benchmarks.attacks.ros_side ROLE SECONDS``, master in ROS_MASTER_URI.

Each attacker ends after SECONDS, or at SIGTERM, and unregisters its nodes at the master. Most attackers are
defined in `tests.ros.strangers`, which tests use too.
"""

from __future__ import annotations

import robots.bridge.ros  # noqa: F401  (first: makes rospy importable)

# isort: split
import itertools
import os
import signal
import struct
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from typing import Any
from xmlrpc.client import ServerProxy

import rospy

from robots.shared.ros.message_types.classes import message_class
from tests.ros import strangers
from tests.ros.strangers import HOST, LONG, Node, framed, stamped, text

DRIVE, ODOMETRY, SONAR = "/key_vel", "/mobile_base_controller/odom", "/sonar_base"
DEPTH, MOTIONS = "/xtion/depth_registered/image_raw", "/play_motion"
PIXELS, DEPTH_HZ = (4000, 3000), 3.0
SMALL_HZ, SMALL_BURST = 2000.0, 20
TOPICS = 1500
MOVING_HZ, MOVING_RADPS = 20.0, -0.4
AGAIN_S = 1.0

Attack = Callable[[str], AbstractContextManager[Any]]  # called with the master's address


@contextmanager
def long_type(master_uri: str) -> Iterator[None]:
    """Run `strangers.long_type`; then register the true type again, because the master keeps the last one."""
    with strangers.long_type(master_uri):
        yield
    with Node(master_uri, "/mender") as node:
        node.publish(DRIVE, "geometry_msgs/Twist")


@contextmanager
def long_result(_master_uri: str) -> Iterator[None]:
    """End each requested motion at once, with a result of 9 MB of text."""
    join("long_result")
    kind = message_class("play_motion_msgs/PlayMotionActionResult")
    publisher = rospy.Publisher(f"{MOTIONS}/result", kind, queue_size=4)

    def answer(goal: Any) -> None:
        result = kind()
        result.status.goal_id = goal.goal_id
        result.status.status = 4  # ABORTED
        result.status.text = result.result.error_string = "x" * LONG
        publisher.publish(result)

    rospy.Subscriber(f"{MOTIONS}/goal", message_class("play_motion_msgs/PlayMotionActionGoal"), answer)
    yield


@contextmanager
def large_pictures(master_uri: str) -> Iterator[None]:
    """Publish as a second depth camera of 12 million pixels."""
    width, height = PIXELS
    size = struct.pack("<II", height, width) + text("32FC1") + struct.pack("<BI", 0, 4 * width)
    pixels = framed(struct.pack("<f", 3.0) * (width * height))
    pictures = (
        framed(stamped(number, "xtion_depth_optical_frame") + size + pixels) for number in itertools.count()
    )
    with Node(master_uri, "/large_pictures") as node:
        node.publish(DEPTH, "sensor_msgs/Image", lambda: pictures, DEPTH_HZ)
        yield


@contextmanager
def small_messages(master_uri: str) -> Iterator[None]:
    """Repeat the robot's own odometry and sonar readings, each 2000 times a second."""
    join("small_messages")
    latest: dict[str, bytes] = {}

    def keep(topic: str) -> Callable[[Any], None]:
        def hear(message: Any) -> None:
            if message._connection_header.get("callerid") != "/small_messages":
                latest[topic] = framed(message._buff)

        return hear

    def again(topic: str) -> Iterator[bytes]:
        while True:
            yield SMALL_BURST * latest.get(topic, b"")

    with Node(master_uri, "/small_messages") as node:
        for topic, kind in ((ODOMETRY, "nav_msgs/Odometry"), (SONAR, "sensor_msgs/Range")):
            rospy.Subscriber(topic, rospy.AnyMsg, keep(topic))
            node.publish(topic, kind, lambda topic=topic: again(topic), SMALL_HZ / SMALL_BURST)  # type: ignore[misc]
        yield


@contextmanager
def many_topics(master_uri: str) -> Iterator[None]:
    """Register 1500 nodes with one topic each; their names have hundreds of characters."""
    master = ServerProxy(master_uri)
    uri = f"http://{HOST}:1/"  # no server listens there
    names = [(f"/many_{'n' * 200}_{number}", f"/many_{'t' * 200}_{number}") for number in range(TOPICS)]
    for node, topic in names:
        master.registerPublisher(node, topic, "std_msgs/String", uri)
    yield
    for node, topic in names:
        master.unregisterPublisher(node, topic, uri)


def again(attack: Attack) -> Attack:
    """Start the attack again every second, because it ends when the bridge ends."""

    @contextmanager
    def repeated(master_uri: str) -> Iterator[None]:
        ended = threading.Event()

        def repeat() -> None:
            while not ended.is_set():
                with ExitStack() as stack:
                    with suppress(OSError, LookupError):  # there may be no bridge now
                        stack.enter_context(attack(master_uri))
                    ended.wait(AGAIN_S)

        thread = threading.Thread(target=repeat, daemon=True)
        thread.start()
        try:
            yield
        finally:
            ended.set()
            thread.join(2.0)

    return repeated


@contextmanager
def navigate(_master_uri: str) -> Iterator[None]:
    """Turn the robot all the time, like navigation with a lower mux priority. This is not an attack."""
    join("navigate")
    twist = message_class("geometry_msgs/Twist")
    publisher = rospy.Publisher("/nav_vel", twist, queue_size=1, tcp_nodelay=True)
    message = twist()
    message.angular.z = MOVING_RADPS

    def publish() -> None:
        while True:
            publisher.publish(message)
            time.sleep(1.0 / MOVING_HZ)

    threading.Thread(target=publish, daemon=True).start()
    yield


def join(role: str) -> None:
    """Start a rospy node."""
    rospy.init_node(f"attack_{role}", anonymous=True, disable_signals=True)


ROLES: dict[str, Attack] = {
    "long-name": strangers.long_name,
    "long-type": long_type,
    "long-result": long_result,
    "huge-scans": strangers.huge_scans,
    "fast-scans": strangers.fast_scans,
    "large-pictures": large_pictures,
    "declared-scan": strangers.declared_scan,
    "declared-header": again(strangers.declared_header),
    "declared-call": again(strangers.declared_call),
    "frames": strangers.frames,
    "small-messages": small_messages,
    "many-topics": many_topics,
    "navigate": navigate,
}


def main() -> None:
    """Run the role of the first argument."""
    role, seconds = sys.argv[1], float(sys.argv[2])
    over = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: over.set())
    os.nice(10)  # an attacker usually has its own computer
    with ROLES[role](os.environ["ROS_MASTER_URI"]) as node:
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s and not over.wait(0.5):
            pass  # wake up regularly: Python handles signals on this thread only
        if isinstance(node, Node):
            print(f"{node.sent} sent, {node.dropped} connections were closed", flush=True)
    os._exit(0)  # do not wait for threads that hang in a send


if __name__ == "__main__":
    main()
