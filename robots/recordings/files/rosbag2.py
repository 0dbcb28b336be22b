"""Messages of a recording of ROS 2 for `rosbag2`, which reads files with one encoding only.

The console's own channels are JSON: here they are std_msgs/String with their text.
"""

from __future__ import annotations

import struct

from mcap.records import Channel, Message, Schema

from robots.recordings.files.bag import NoBag
from robots.recordings.files.contents import Recorded
from robots.shared.messages.serialization import CDR

_STRING = Schema(id=2**16 - 1, name="std_msgs/msg/String", encoding="ros2msg", data=b"string data\n")
# Of a latched channel: `ros2 bag play` keeps its messages for listeners that come later.
_TIMES = ("deadline", "lifespan", "liveliness_lease_duration")
_KEPT = "\n".join(
    (
        "- history: 1",
        "  depth: 1",
        "  reliability: 1",
        "  durability: 1",
        "  liveliness: 1",
        *(f"  {time}: {{sec: 9223372036, nsec: 854775807}}" for time in _TIMES),
        "  avoid_ros_namespace_conventions: false",
    )
)


def for_rosbag2(recorded: Recorded) -> Recorded:
    """Return a message as rosbag2 reads it. Raises `NoBag` for messages of ROS 1."""
    schema, channel, message = recorded
    if channel.message_encoding == "cdr":
        kept = channel.metadata.get("latching") == "1"
        return Recorded(schema, _cdr(channel, {"offered_qos_profiles": _KEPT if kept else ""}), message)
    if channel.message_encoding != "json":
        raise NoBag(channel.message_encoding)
    text = message.data + CDR.text_end
    data = CDR.head + struct.pack("<I", len(text)) + text
    return Recorded(_STRING, _cdr(channel, {}), _with(message, data))


def _cdr(channel: Channel, more: dict[str, str]) -> Channel:
    return Channel(
        id=channel.id,
        topic=channel.topic,
        message_encoding="cdr",
        metadata=channel.metadata | more,
        schema_id=channel.schema_id,
    )


def _with(message: Message, data: bytes) -> Message:
    return Message(
        channel_id=message.channel_id,
        log_time=message.log_time,
        data=data,
        publish_time=message.publish_time,
        sequence=message.sequence,
    )
