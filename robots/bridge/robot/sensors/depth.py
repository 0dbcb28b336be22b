"""A depth camera's messages: prepares pictures for the gate.

A thread of the robot's side thins out each picture and computes its pose, so that the event loop gets little data.
"""

from __future__ import annotations

import time
from collections import deque
from typing import NamedTuple, Protocol

from robots.bridge.gate.obstacles.depth_camera import Frame, frame_of
from robots.bridge.gate.sensing.depth import (
    Cloud,
    DepthImage,
    Lens,
    Picture,
    picture_of_cloud,
    picture_of_image,
)
from robots.bridge.gate.sensing.scan import Malformed
from robots.bridge.robot.incoming.reception import Reception
from robots.bridge.robot.sensors.frames import Frames, Matrix, PoseUnknown
from robots.shared.configuration.bridge_config import DepthSource
from robots.shared.configuration.gate_profile import DepthView
from robots.shared.sentences import say
from robots.shared.texts import SENTENCE, cut

EARLY_SHARE = 0.8  # of the time between two pictures: a picture may arrive a little early
RESTS_S = 0.2  # between two pictures while the robot rests: well within the limit of their age


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


class _Shot(NamedTuple):
    """A picture or cloud that is not thinned out yet, and the camera's pose."""

    content: DepthImage | Cloud
    stamp_s: float
    arrival_s: float
    to_base: Matrix


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
        self._waiting: deque[_Shot] = deque(maxlen=1)  # the newest, if it came after the last one taken
        reception.undecoded.append(self.take_waiting)

    def learn(self, raw: bytes) -> None:
        """Keep the first valid camera info: it comes with each picture and stays the same."""
        if self._info is None:
            width, height, lens = self._reader.info(raw)
            if width > 0 and height > 0 and lens.makes_sense:
                self._info = (width, height, lens)

    def receive(self, raw: bytes) -> None:
        """Take a picture or cloud, unless the last one is too young."""
        arrival_s = time.monotonic()
        passed_s = arrival_s - self._taken_s
        if passed_s < EARLY_SHARE * self._source.every_s:
            return
        waits = self._reception.core.rests and passed_s < EARLY_SHARE * RESTS_S
        if not waits:
            self._taken_s = arrival_s
        try:
            read = self._reader.cloud if self._source.type.endswith("/PointCloud2") else self._reader.image
            stamp_s, frame_id, content = read(raw)
            shot = _Shot(content, stamp_s, arrival_s, self._frames.pose_at(frame_id.lstrip("/"), stamp_s))
            if waits:
                self._waiting.append(shot)
                return
            frame = self._frame(shot)
            self._waiting.clear()
            self._reception.depth(frame, stamp_s, arrival_s)
        except (Malformed, PoseUnknown) as error:
            self._cannot_use(error.args[0])
        except Unreadable as error:
            self._cannot_use(say("its messages cannot be read ({error})", error=error))

    def _cannot_use(self, why: str) -> None:
        self._reception.bad_depth(cut(why, SENTENCE))

    def take_waiting(self) -> None:
        """Pass the picture that waits to the core, if one does, on the event loop."""
        try:
            shot = self._waiting.pop()
        except IndexError:
            return
        self._taken_s = shot.arrival_s
        try:
            self._reception.core.depth(self._frame(shot), shot.stamp_s, shot.arrival_s)
        except Malformed as error:
            self._cannot_use(error.args[0])

    def forget(self) -> None:
        """Forget the picture that waits."""
        self._waiting.clear()

    def _frame(self, shot: _Shot) -> Frame:
        content = shot.content
        picture = self._image(content) if isinstance(content, DepthImage) else self._cloud(content)
        return frame_of(picture, shot.to_base, self._view)

    def _image(self, image: DepthImage) -> Picture:
        return picture_of_image(image, self._lens(image.width, image.height))

    def _lens(self, width: int, height: int) -> Lens:
        """Return the lens for pictures of this size: from camera info, else from the profile's field of view."""
        if self._info is None or not (width and height):
            return Lens.seeing(self._source.fov, max(width, 1), max(height, 1))
        of_width, of_height, lens = self._info
        across, along = width / of_width, height / of_height
        return Lens(lens.fx * across, lens.fy * along, lens.cx * across, lens.cy * along)

    def _cloud(self, cloud: Cloud) -> Picture:
        return picture_of_cloud(cloud, self._source.fov)
