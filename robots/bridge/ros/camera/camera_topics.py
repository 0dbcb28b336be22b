"""The topics of cameras, and their messages."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import genpy
import rospy
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from robots.bridge.camera.camera_side import Taken, Unreadable
from robots.bridge.ros.bounds.listening import pause
from robots.bridge.ros.bounds.sizes import expect
from robots.bridge.ros.sensors.raw_bytes import BUFFER_BYTES, listen
from robots.bridge.ros.sensors.tf import TfTopics
from robots.shared.configuration.bridge_config import CameraSource

TF_EVERY_S = 0.06  # between two reads of tf: a read of each single message took half of the process's time
INFO_EVERY_S = 0.3  # between two reads of the camera info, once it is known


class Subscription:
    """The topics of one camera."""

    def __init__(self, pictures: rospy.Subscriber, *others: rospy.Subscriber) -> None:
        self._pictures = pictures
        self._others = others

    @property
    def publishers(self) -> int:
        return int(self._pictures.get_num_connections())

    def close(self) -> None:
        for subscriber in (self._pictures, *self._others):
            subscriber.unregister()


class CameraTopics:
    """The cameras of one robot, and their poses in the frame `base`."""

    def __init__(self, base: str) -> None:
        tf = TfTopics(base)
        self.frames = tf.frames
        pause("/tf", lambda: TF_EVERY_S)
        self._tf_subscribers = tf.listen()

    def listen(
        self,
        source: CameraSource,
        picture: Callable[[rospy.AnyMsg], None],
        info: Callable[[bytes], None],
        knows_info: Callable[[], bool],
    ) -> Subscription:
        expect(source.topic, source.type)
        pictures = rospy.Subscriber(
            source.topic, rospy.AnyMsg, picture, queue_size=1, buff_size=BUFFER_BYTES, tcp_nodelay=True
        )
        if not source.info:
            return Subscription(pictures)
        pause(source.info, lambda: INFO_EVERY_S if knows_info() else 0.0)
        return Subscription(pictures, listen(source.info, "sensor_msgs/CameraInfo", info))

    def type_of(self, message: rospy.AnyMsg) -> str:
        return str(message._connection_header.get("type", "*"))

    def read(self, message: rospy.AnyMsg) -> Taken:
        is_compressed = self.type_of(message) == "sensor_msgs/CompressedImage"
        found: Any = (CompressedImage if is_compressed else Image)()
        try:
            found.deserialize(message._buff)
        except genpy.DeserializationError as error:
            raise Unreadable(error) from error
        return Taken(found.header.stamp.to_sec(), found.header.frame_id, found)

    def read_info(self, raw: bytes) -> CameraInfo:
        try:
            return CameraInfo().deserialize(raw)
        except genpy.DeserializationError as error:
            raise Unreadable(error) from error
