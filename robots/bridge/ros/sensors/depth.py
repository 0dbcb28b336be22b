"""A depth camera's topics. Only rospy copies the megabyte of a picture's pixels."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import genpy
import rospy
from sensor_msgs.msg import CameraInfo, PointCloud2, PointField

from robots.bridge.gate.sensing.depth import Cloud, DepthImage, Lens
from robots.bridge.robot.sensors.depth import DepthReception, Unreadable
from robots.bridge.ros.sensors.brief import depth_image
from robots.bridge.ros.sensors.raw_bytes import listen
from robots.shared.configuration.bridge_config import DepthSource


class DepthTopics:
    """The topics of one depth camera."""

    def __init__(self, source: DepthSource, reception: DepthReception) -> None:
        self._source = source
        self._reception = reception

    def listen(self) -> list[rospy.Subscriber]:
        """Subscribe."""
        subscribers = [listen(self._source.topic, self._source.type, self._reception.receive, queue=1)]
        if self._source.info:
            subscribers.append(listen(self._source.info, "sensor_msgs/CameraInfo", self._reception.learn))
        return subscribers

    def forget(self) -> None:
        """Forget the picture that waits."""
        self._reception.forget()


class DepthMessages:
    """Reads the messages of ROS 1."""

    def image(self, raw: bytes) -> tuple[float, str, DepthImage]:
        with _read():
            return depth_image(raw)

    def cloud(self, raw: bytes) -> tuple[float, str, Cloud]:
        with _read():
            message: Any = PointCloud2().deserialize(raw)
        offsets = {
            field.name: field.offset for field in message.fields if field.datatype == PointField.FLOAT32
        }
        cloud = Cloud(
            message.width,
            message.height,
            message.point_step,
            message.row_step,
            offsets,
            bool(message.is_bigendian),
            message.data,
        )
        return message.header.stamp.to_sec(), message.header.frame_id, cloud

    def info(self, raw: bytes) -> tuple[int, int, Lens]:
        info = CameraInfo().deserialize(raw)
        return info.width, info.height, Lens(info.K[0], info.K[4], info.K[2], info.K[5])


@contextmanager
def _read() -> Iterator[None]:
    try:
        yield
    except (genpy.DeserializationError, struct.error) as error:
        raise Unreadable(error) from error
