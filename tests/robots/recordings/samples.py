"""A recording for tests."""

from __future__ import annotations

import io
import struct

from mcap.writer import Writer

ODOM = """float64[] speeds
geometry_msgs/Point at
================================================================================
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
"""
SECOND = 1_000_000_000


def sample(
    seconds: int = 10, encoding: str = "ros1", begins_s: int = 0, holder: str = "", about: str = ""
) -> io.BytesIO:
    """A recording: a latched map, a topic of 10 Hz with two speeds and a place, pictures, and a channel of JSON.

    `holder`: a name in that channel; `about`: `TakenRecording` in the metadata.
    """
    stream = io.BytesIO()
    writer = Writer(stream, chunk_size=2000)
    profile = "ros2" if encoding == "cdr" else "ros1"
    writer.start(profile=profile, library="test")
    kinds = {
        "/map": writer.register_schema("std_msgs/String", f"{profile}msg", b"string data"),
        "/odom": writer.register_schema("a_msgs/Odom", f"{profile}msg", ODOM.encode()),
        "/camera": writer.register_schema("sensor_msgs/Image", f"{profile}msg", b"uint8[] data"),
    }
    channels = {
        topic: writer.register_channel(
            topic, encoding, kind, {"md5sum": "0" * 32, "latching": "1" if topic == "/map" else "0"}
        )
        for topic, kind in kinds.items()
    }
    view = writer.register_channel("/fleet/view", "json", writer.register_schema("v", "jsonschema", b"{}"))
    text = struct.pack("<I", 3) + b"map"
    writer.add_message(channels["/map"], begins_s * SECOND, text, begins_s * SECOND, 0)
    for tick in range(seconds * 10):
        at_ns = begins_s * SECOND + tick * SECOND // 10
        odom = struct.pack("<Iddddd", 2, tick, -tick, 1.0, 2.0, tick / 10)
        writer.add_message(channels["/odom"], at_ns, odom, at_ns, tick)
        writer.add_message(channels["/camera"], at_ns, struct.pack("<I", 50) + bytes(50), at_ns, tick)
        name = b'"holder":"%s",' % holder.encode() if holder else b""
        writer.add_message(view, at_ns, b'{"state":{%s"speed":%d}}' % (name, tick), at_ns, tick)
    writer.add_metadata("fleet", {"taken": about} if about else {"robot": "tiago-1"})
    writer.finish()
    stream.seek(0)
    return stream
