"""Messages of depth cameras, read from their bytes, which are not copied."""

from __future__ import annotations

from robots.bridge.gate.sensing.depth import Cloud, DepthImage, Lens
from robots.bridge.ros2.sensors.cdr import Cdr

FLOAT32 = 7  # sensor_msgs/msg/PointField.FLOAT32
MOST_FIELDS = 100  # of a point; coefficients of a lens


def depth_image(raw: bytes) -> tuple[float, str, DepthImage]:
    """Return stamp, frame and picture of a sensor_msgs/msg/Image."""
    message = Cdr(raw)
    stamp_s, frame = message.header()
    height, width = message.values("2I", 4)
    encoding = message.text()
    big_endian, step = message.number("B", 1), message.number()
    data = message.data(message.number())
    return stamp_s, frame, DepthImage(width, height, encoding, bool(big_endian), step, data)


def cloud(raw: bytes) -> tuple[float, str, Cloud]:
    """Return stamp, frame and points of a sensor_msgs/msg/PointCloud2."""
    message = Cdr(raw)
    stamp_s, frame = message.header()
    height, width = message.values("2I", 4)
    offsets = {}
    for _ in range(min(message.number(), MOST_FIELDS)):
        name, offset, kind = message.text(), message.number(), message.number("B", 1)
        message.number()
        if kind == FLOAT32:
            offsets[name] = offset
    big_endian = message.number("B", 1)
    point_step, row_step = message.values("2I", 4)
    data = message.data(message.number())
    return stamp_s, frame, Cloud(width, height, point_step, row_step, offsets, bool(big_endian), data)


def lens(raw: bytes) -> tuple[int, int, Lens]:
    """Return width, height and lens of a sensor_msgs/msg/CameraInfo."""
    message = Cdr(raw)
    message.skip_header()
    height, width = message.values("2I", 4)
    message.skip_text()
    if distortions := message.number():
        message.values(f"{min(distortions, MOST_FIELDS)}d", 8)
    fx, _, cx, _, fy, cy, *_ = message.values("9d", 8)
    return width, height, Lens(fx, fy, cx, cy)
