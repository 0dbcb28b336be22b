"""A depth camera's messages: prepares pictures for the gate.

A thread of the robot's side thins out each picture and computes its pose, so that the event loop gets little data.
"""

from __future__ import annotations

import time
from typing import Protocol

from robots.bridge.gate.obstacles.depth_camera import frame_of
from robots.bridge.gate.sensing.depth import (
    Cloud,
    DepthImage,
    Lens,
    Picture,
    picture_of_cloud,
    picture_of_image,
)
from robots.bridge.gate.sensing.scan import Malformed
from robots.bridge.robot.reception import Reception
from robots.bridge.robot.sensors.frames import Frames, PoseUnknown
from robots.shared.configuration.bridge_config import DepthSource
from robots.shared.configuration.gate_profile import DepthView
from robots.shared.sentences import say
from robots.shared.texts import SENTENCE, cut

EARLY_SHARE = 0.8  # of the time between two pictures: a picture may arrive a little early


class Unreadable(Exception):
    """A message that is not of its type, or is cut."""


class DepthReader(Protocol):
    """Reads the bytes of a side's messages. Raises Unreadable."""

    def image(self, raw: bytes) -> tuple[float, str, DepthImage]:
        """Return stamp, frame and picture of an Image."""

    def cloud(self, raw: bytes) -> tuple[float, str, Cloud]:
        """Return stamp, frame and points of a PointCloud2."""

    def info(self, raw: bytes) -> tuple[int, int, Lens]:
        """Return width, height and lens of a CameraInfo."""


class DepthReception:
    """The messages of one depth camera, on the threads of a side. Pictures go to the core, on the loop."""

    def __init__(
        self,
        source: DepthSource,
        view: DepthView,
        frames: Frames,
        reception: Reception,
        reader: DepthReader,
    ) -> None:
        self._source = source
        self._view = view
        self._frames = frames
        self._reception = reception
        self._reader = reader
        self._info: tuple[int, int, Lens] | None = None  # width and height of its pictures, lens
        self._taken_s = float("-inf")

    def learn(self, raw: bytes) -> None:
        """Keep the first valid camera info: it comes with each picture and stays the same."""
        if self._info is None:
            width, height, lens = self._reader.info(raw)
            if width > 0 and height > 0 and lens.makes_sense:
                self._info = (width, height, lens)

    def receive(self, raw: bytes) -> None:
        """Take a picture or cloud, unless the last one is too young."""
        arrival_s = time.monotonic()
        if arrival_s - self._taken_s < EARLY_SHARE * self._source.every_s:
            return
        self._taken_s = arrival_s
        try:
            stamp_s, frame_id, picture = self._cloud(raw) if self._is_cloud else self._image(raw)
            to_base = self._frames.pose_at(frame_id.lstrip("/"), stamp_s)
            frame = frame_of(picture, to_base, self._view)
            self._reception.depth(frame, stamp_s, arrival_s)
        except (Malformed, PoseUnknown) as error:
            self._cannot_use(error.args[0])
        except Unreadable as error:
            self._cannot_use(say("its messages cannot be read ({error})", error=error))

    def _cannot_use(self, why: str) -> None:
        self._reception.bad_depth(cut(why, SENTENCE))

    @property
    def _is_cloud(self) -> bool:
        return self._source.type.endswith("/PointCloud2")

    def _image(self, raw: bytes) -> tuple[float, str, Picture]:
        stamp_s, frame_id, image = self._reader.image(raw)
        return stamp_s, frame_id, picture_of_image(image, self._lens(image.width, image.height))

    def _lens(self, width: int, height: int) -> Lens:
        """Return the lens for pictures of this size: from camera info, else from the profile's field of view."""
        if self._info is None or not (width and height):
            return Lens.seeing(self._source.fov, max(width, 1), max(height, 1))
        of_width, of_height, lens = self._info
        across, along = width / of_width, height / of_height
        return Lens(lens.fx * across, lens.fy * along, lens.cx * across, lens.cy * along)

    def _cloud(self, raw: bytes) -> tuple[float, str, Picture]:
        stamp_s, frame_id, cloud = self._reader.cloud(raw)
        return stamp_s, frame_id, picture_of_cloud(cloud, self._source.fov)
