"""``python -m benchmarks.soak.witness_side``: print each message that reaches the robot in ROS_MASTER_URI.

Each line is a `Received`. A goal is printed twice: when it is sent, and when the robot reports its status.
"""

from __future__ import annotations

import robots.bridge.ros  # noqa: F401  (first: makes rospy importable)

# isort: split
import signal
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import msgspec
import rospy
from actionlib_msgs.msg import GoalStatusArray
from geometry_msgs.msg import Twist
from std_msgs.msg import String

from benchmarks.soak.reconciliation import Received
from robots.shared.ros.message_types.classes import message_class

DRIVE_TOPICS = ("/key_vel", "/phone_vel")
NOTES = "/fleet_demo/notes"

_speaking = threading.Lock()


def tell(kind: str, key: str, goal: str = "") -> None:
    """Write one line at once."""
    line = msgspec.json.encode(Received(kind, time.time(), key, goal)) + b"\n"
    with _speaking:
        sys.stdout.buffer.write(line)
        sys.stdout.buffer.flush()


def drives(topic: str) -> Callable[[Twist], None]:
    """Return a callback that prints velocities that are not zero."""

    def heard(twist: Twist) -> None:
        parts = (*_vector(twist.linear), *_vector(twist.angular))
        if any(parts):
            tell("drive.start", topic)

    return heard


def goals(kind: str, key: Callable[[Any], str]) -> Callable[[Any], None]:
    """Return a callback that prints goals that are sent to the robot."""
    return lambda message: tell(kind, key(message.goal), message.goal_id.id)


def statuses(kind: str) -> Callable[[GoalStatusArray], None]:
    """Return a callback that prints goals whose status the robot reports, each once."""
    known: set[str] = set()

    def heard(message: GoalStatusArray) -> None:
        for status in message.status_list:
            if status.goal_id.id not in known:
                known.add(status.goal_id.id)
                tell(kind, "", status.goal_id.id)

    return heard


def main() -> None:
    """Run until SIGTERM."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    rospy.init_node("witness", anonymous=True, disable_signals=True)
    for topic in DRIVE_TOPICS:
        rospy.Subscriber(topic, Twist, drives(topic), tcp_nodelay=True)
    rospy.Subscriber(NOTES, String, lambda message: tell("publish.start", message.data))
    for name, kind, type_, key in (
        ("/tts", "speech.start", "pal_interaction_msgs/TtsActionGoal", lambda goal: goal.rawtext.text),
        (
            "/play_motion",
            "motion.start",
            "play_motion_msgs/PlayMotionActionGoal",
            lambda goal: goal.motion_name,
        ),
    ):
        rospy.Subscriber(f"{name}/goal", message_class(type_), goals(kind, key))
        rospy.Subscriber(f"{name}/status", GoalStatusArray, statuses(kind))
    tell("ready", "")
    rospy.spin()


def _vector(vector: Any) -> tuple[float, float, float]:
    return vector.x, vector.y, vector.z


if __name__ == "__main__":
    main()
