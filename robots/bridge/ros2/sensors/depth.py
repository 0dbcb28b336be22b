"""A depth camera's topics. A thread of its own prepares the newest picture, while the executor reads tf for it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from robots.bridge.gate.sensing.depth import Cloud, DepthImage, Lens
from robots.bridge.robot.sensors.depth import DepthReception, Unreadable
from robots.bridge.robot.sensors.on_demand_topics import Subscription
from robots.bridge.ros2.followed import FollowedTopics
from robots.bridge.ros2.participant import Participant, guarded
from robots.bridge.ros2.qos import pictures as pictures_qos
from robots.bridge.ros2.qos import sensor
from robots.bridge.ros2.sensors import pictures
from robots.shared.configuration.bridge_config import DepthSource


class DepthTopics:
    """The topics of one depth camera."""

    def __init__(
        self,
        participant: Participant,
        followed: FollowedTopics,
        source: DepthSource,
        reception: DepthReception,
    ) -> None:
        self._participant, self._followed = participant, followed
        self._source, self._reception = source, reception
        self._newest = _Newest(guarded(reception.receive))  # no picture may end its thread

    def listen(self) -> Sequence[Subscription]:
        """Subscribe."""
        source = self._source
        images = self._followed.listen(source.topic, source.type, self._take, pictures_qos)
        if not source.info:
            return [images]
        kind = "sensor_msgs/msg/CameraInfo"
        return [images, self._participant.listen(source.info, kind, self._learn, sensor(1))]

    def forget(self) -> None:
        """Forget the picture that waits."""
        self._reception.forget()

    def _take(self, raw: bytes, _info: Any) -> None:
        self._newest.put(raw)

    def _learn(self, raw: bytes, _info: Any) -> None:
        self._reception.learn(raw)


class DepthMessages:
    """Reads the messages of ROS 2."""

    def image(self, raw: bytes) -> tuple[float, str, DepthImage]:
        """Return stamp, frame and picture of an Image."""
        with _read():
            return pictures.depth_image(raw)

    def cloud(self, raw: bytes) -> tuple[float, str, Cloud]:
        """Return stamp, frame and points of a PointCloud2."""
        with _read():
            return pictures.cloud(raw)

    def info(self, raw: bytes) -> tuple[int, int, Lens]:
        """Return width, height and lens of a CameraInfo."""
        return pictures.lens(raw)


@contextmanager
def _read() -> Iterator[None]:
    try:
        yield
    except ValueError as error:
        raise Unreadable(error) from error


class _Newest:
    """Runs `take` with the newest bytes, on a thread that ends with the process."""

    def __init__(self, take: Callable[[bytes], None]) -> None:
        self._take = take
        self._raw: bytes | None = None
        self._news = threading.Condition()
        threading.Thread(target=self._run, name="depth", daemon=True).start()

    def put(self, raw: bytes) -> None:
        with self._news:
            self._raw = raw
            self._news.notify()

    def _run(self) -> None:
        while True:
            with self._news:
                self._news.wait_for(lambda: self._raw is not None)
                raw, self._raw = self._raw, None
            if raw is not None:
                self._take(raw)
