"""Limits of size and rate of each message type, checked before a message is deserialized.

The limits of lasers and depth cameras follow from the gate's needs; the others are far above the data of real
robots.
"""

from __future__ import annotations

from typing import NamedTuple

from robots.shared.configuration.gate_profile import MOST_BEAMS

KB, MB = 1024, 1024 * 1024
BRIEF = 4 * KB  # header, names and a few numbers


class Kind(NamedTuple):
    """Limits of one publisher of a topic."""

    most_bytes: int = 64 * KB  # of a message
    most_hz: float = 1000.0
    share: float = 0.25  # of a core, to read from this publisher on its own thread
    publishers: int = 16  # of one topic: no more are read


KINDS = {
    "sensor_msgs/LaserScan": Kind(BRIEF + 2 * 4 * MOST_BEAMS, 200.0),  # ranges and intensities
    # At 640 x 480 and 30 Hz, copying alone takes 0.05 of a core for images and 0.33 for clouds; a slow
    # computer needs three times as much.
    "sensor_msgs/Image": Kind(16 * MB, 120.0, share=0.6),
    "sensor_msgs/CompressedImage": Kind(8 * MB, 120.0, share=0.6),
    "sensor_msgs/PointCloud2": Kind(32 * MB, 120.0, share=0.9),
    "sensor_msgs/CameraInfo": Kind(16 * KB, 200.0),
    "nav_msgs/Odometry": Kind(BRIEF),
    # 5,000 poses are 0.4 MB and take 0.03 s; planners send a few a second.
    "nav_msgs/Path": Kind(1 * MB, 20.0, share=0.5),
    "sensor_msgs/Range": Kind(BRIEF),
    "sensor_msgs/BatteryState": Kind(BRIEF),
    "std_msgs/Float32": Kind(BRIEF),
    "diagnostic_msgs/DiagnosticArray": Kind(256 * KB, 200.0),  # each node of a robot sends its own
    "std_msgs/Bool": Kind(BRIEF),
    # Each static transform of a robot may have its own node.
    "tf2_msgs/TFMessage": Kind(256 * KB, 2000.0, publishers=64),
    # Any type: only inspector and tap subscribe this way, in processes of their own. Each node publishes its log.
    "*": Kind(32 * MB, 20_000.0, share=2.0, publishers=64),
}

_expected: dict[str, str] = {}  # type by topic, for topics that are subscribed without a type


def expect(topic: str, type_name: str) -> None:
    """Use the limits of this type for a topic that is read as bytes."""
    _expected[topic] = type_name


def kind_of(topic: str, type_name: str) -> Kind:
    """Return the limits of a publisher of this topic that is read as this type."""
    return KINDS.get(_expected.get(topic, type_name), Kind())
