"""The topics of cameras, and their messages, which are read from their bytes."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from robots.bridge.camera.camera_side import Taken, Unreadable
from robots.bridge.ros2.followed import FollowedTopic, FollowedTopics
from robots.bridge.ros2.network.graph import Graph
from robots.bridge.ros2.participant import Participant
from robots.bridge.ros2.participant import Subscription as Topic
from robots.bridge.ros2.qos import pictures, sensor
from robots.bridge.ros2.sensors.cdr import Cdr
from robots.bridge.ros2.sensors.pictures import MOST_FIELDS, depth_image
from robots.bridge.ros2.sensors.tf import TfTopics
from robots.shared.configuration.bridge_config import CameraSource

INFO = "sensor_msgs/msg/CameraInfo"
INFO_EVERY_S = 0.3  # between two camera infos that are looked at, once it is known
LOOK_S = 0.3  # between two looks at what the publishers of pictures offer


class Message(NamedTuple):
    """A message with a picture, as it came."""

    type: str
    raw: bytes


class Compressed(NamedTuple):
    """The fields of a sensor_msgs/msg/CompressedImage."""

    format: str
    data: memoryview


class Image(NamedTuple):
    """The fields of a sensor_msgs/msg/Image."""

    width: int
    height: int
    encoding: str
    is_bigendian: bool
    step: int
    data: bytes | memoryview


@dataclass
class Info:
    """The fields of a sensor_msgs/msg/CameraInfo."""

    width: int
    height: int
    distortion_model: str
    D: Sequence[float]
    K: Sequence[float]
    P: Sequence[float]


class Subscription:
    """The topics of one camera."""

    def __init__(self, pictures: FollowedTopic, *others: Topic) -> None:
        self._pictures, self._others = pictures, others

    @property
    def publishers(self) -> int:
        """Return the number of publishers of pictures at the last look."""
        return self._pictures.publishers

    def close(self) -> None:
        self._pictures.unregister()
        for topic in self._others:
            topic.unregister()


class CameraTopics:
    """The cameras of one robot, and their poses in the frame `base`."""

    def __init__(self, participant: Participant, namespace: str, base: str) -> None:
        self._participant = participant
        tf = TfTopics(participant, namespace, base)
        self.frames = tf.frames
        self._tf_topics = tf.listen()
        self._followed = FollowedTopics(participant, Graph(participant.node))
        participant.work(self._follow, "publishers")

    def listen(
        self,
        source: CameraSource,
        picture: Callable[[Any], None],
        info: Callable[[bytes], None],
        knows_info: Callable[[], bool],
    ) -> Subscription:
        infos = [self._listen_info(source.info, info, knows_info)] if source.info else []

        def take(raw: bytes, _info: Any) -> None:
            picture(Message(source.type, raw))

        return Subscription(self._followed.listen(source.topic, source.type, take, pictures), *infos)

    def _listen_info(
        self, topic: str, info: Callable[[bytes], None], knows_info: Callable[[], bool]
    ) -> Topic:
        due_s = 0.0

        def take(raw: bytes, _info: Any) -> None:
            nonlocal due_s
            now_s = time.monotonic()
            if not knows_info() or now_s >= due_s:
                due_s = now_s + INFO_EVERY_S
                info(raw)

        return self._participant.listen(topic, INFO, take, sensor(1))

    def _follow(self) -> None:
        """Follow what publishers offer, without end."""
        while True:
            time.sleep(LOOK_S)
            self._followed.follow()

    def type_of(self, message: Message) -> str:
        return message.type

    def read(self, message: Message) -> Taken:
        try:
            if not message.type.endswith("/CompressedImage"):
                stamp_s, frame, image = depth_image(message.raw)
                return Taken(stamp_s, frame, Image(*image))
            picture = Cdr(message.raw)
            stamp_s, frame = picture.header()
            return Taken(stamp_s, frame, Compressed(picture.text(), picture.data(picture.number())))
        except ValueError as error:
            raise Unreadable(error) from error

    def read_info(self, raw: bytes) -> Info:
        message = Cdr(raw)
        try:
            message.skip_header()
            height, width = message.values("2I", 4)
            model, count = message.text(), message.number()
            if count > MOST_FIELDS:
                raise Unreadable("its lens has too many numbers")
            bends = message.values(f"{count}d", 8) if count else ()
            matrix, _, projection = (message.values(f"{size}d", 8) for size in (9, 9, 12))
        except ValueError as error:
            raise Unreadable(error) from error
        return Info(width, height, model, bends, matrix, projection)
