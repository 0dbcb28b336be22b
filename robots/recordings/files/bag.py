"""A recording of ROS 1 as a bag (format 2.0), for `rosbag` and programs that read it.

The console's own channels are JSON: the bag has their text as std_msgs/String.
"""

from __future__ import annotations

import struct
from collections.abc import Collection, Sequence
from pathlib import Path

from rosbags.interfaces import Connection
from rosbags.rosbag1 import Writer
from rosbags.typesys.msg import normalize_msgtype

from robots.recordings.files.contents import Contents, Recorded
from robots.recordings.files.cutting import ALL, parts

_STRING = ("std_msgs/msg/String", "string data", "992ce8a1687cec8c8bd883ec73ca41d1")


class NoBag(Exception):
    """Raised for a recording whose messages are not of ROS 1."""


def write_bag(
    contents: Contents,
    target: Path,
    *,
    topics: Collection[str] | None = None,
    windows: Sequence[tuple[int, int]] = ALL,
) -> int:
    """Write the parts (`cutting.cut`) to a path that does not exist; return the number of messages.

    Raises `Unreadable` or `NoBag`.
    """
    connections: dict[int, Connection] = {}
    count = 0
    with Writer(target) as bag:
        for at_ns, recorded in parts(contents, topics, windows):
            channel = recorded.channel
            if channel.id not in connections:
                connections[channel.id] = _connection(bag, recorded)
            data = recorded.message.data
            if channel.message_encoding == "json":
                data = struct.pack("<I", len(data)) + data
            bag.write(connections[channel.id], at_ns, data)
            count += 1
    return count


def _connection(bag: Writer, recorded: Recorded) -> Connection:
    schema, channel, _ = recorded
    if channel.message_encoding == "json":
        kind, text, md5 = _STRING
    elif channel.message_encoding == "ros1" and schema is not None:
        kind, text, md5 = (
            normalize_msgtype(schema.name),
            schema.data.decode(),
            channel.metadata.get("md5sum", "*"),
        )
    else:
        raise NoBag(channel.message_encoding)
    latching = 1 if channel.metadata.get("latching") == "1" else None
    return bag.add_connection(
        channel.topic,
        kind,
        msgdef=text,
        md5sum=md5,
        callerid=channel.metadata.get("callerid"),
        latching=latching,
    )
