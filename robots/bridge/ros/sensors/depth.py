"""A depth camera's topics: prepares pictures for the gate.

A rospy thread thins out each picture and computes its pose, so that the event loop gets little data. Only rospy copies
the megabyte of pixels.
"""

from __future__ import annotations

import struct
import time
from typing import Any

import genpy
import rospy
from sensor_msgs.msg import CameraInfo, PointCloud2, PointField

from robots.bridge.core import Core
from robots.bridge.gate.obstacles.depth_camera import frame_of
from robots.bridge.gate.sensing.depth import (
    Cloud,
    Lens,
    Picture,
    picture_of_cloud,
    picture_of_image,
)
from robots.bridge.gate.sensing.scan import Malformed
from robots.bridge.robot.mailboxes import Mailboxes
from robots.bridge.ros.on_demand_topics import listen
from robots.bridge.ros.sensors.brief import depth_image
from robots.bridge.ros.sensors.frames import Frames, PoseUnknown
from robots.shared.configuration.bridge_config import DepthSource
from robots.shared.configuration.gate_profile import DepthView
from robots.shared.sentences import say
from robots.shared.texts import SENTENCE, cut

EARLY_SHARE = 0.8  # of the time between two pictures: a picture may arrive a little early


class DepthTopics:
    """The topics of one depth camera. Pictures go to `core` through `mail`, on the event loop."""

    def __init__(
        self, source: DepthSource, view: DepthView, frames: Frames, mail: Mailboxes, core: Core
    ) -> None:
        self._source = source
        self._view = view
        self._frames = frames
        self._mail = mail
        self._core = core
        self._info: tuple[int, int, Lens] | None = None  # width and height of its pictures, lens
        self._taken_s = float("-inf")

    def listen(self) -> list[rospy.Subscriber]:
        """Subscribe."""
        subscribers = [listen(self._source.topic, self._source.type, self._receive, queue=1)]
        if self._source.info:
            subscribers.append(listen(self._source.info, "sensor_msgs/CameraInfo", self._learn))
        return subscribers

    def forget(self) -> None:
        """Do nothing: no picture is stored."""

    # --- on rospy's threads ------------------------------------------------------------------------

    def _learn(self, raw: bytes) -> None:
        """Keep the first valid camera info: it comes with each picture and stays the same."""
        if self._info is None:
            info = CameraInfo().deserialize(raw)
            lens = Lens(info.K[0], info.K[4], info.K[2], info.K[5])
            if info.width > 0 and info.height > 0 and lens.makes_sense:
                self._info = (info.width, info.height, lens)

    def _receive(self, raw: bytes) -> None:
        arrival_s = time.monotonic()
        if arrival_s - self._taken_s < EARLY_SHARE * self._source.every_s:
            return
        self._taken_s = arrival_s
        try:
            stamp_s, frame_id, picture = self._cloud(raw) if self._is_cloud else self._image(raw)
            to_base = self._frames.pose_at(frame_id.lstrip("/"), stamp_s)
            frame = frame_of(picture, to_base, self._view)
            self._mail.post("depth", lambda: self._core.depth(frame, stamp_s, arrival_s))
        except (Malformed, PoseUnknown) as error:
            self._cannot_use(error.args[0])
        except (genpy.DeserializationError, struct.error) as error:
            self._cannot_use(say("its messages cannot be read ({error})", error=error))

    def _cannot_use(self, why: str) -> None:
        self._mail.post("bad depth", lambda: self._core.bad_depth(cut(why, SENTENCE)))

    @property
    def _is_cloud(self) -> bool:
        return self._source.type == "sensor_msgs/PointCloud2"

    def _image(self, raw: bytes) -> tuple[float, str, Picture]:
        stamp_s, frame_id, image = depth_image(raw)
        return stamp_s, frame_id, picture_of_image(image, self._lens(image.width, image.height))

    def _lens(self, width: int, height: int) -> Lens:
        """Return the lens for pictures of this size: from camera info, else from the profile's field of view."""
        if self._info is None or not (width and height):
            return Lens.seeing(self._source.fov, max(width, 1), max(height, 1))
        of_width, of_height, lens = self._info
        across, along = width / of_width, height / of_height
        return Lens(lens.fx * across, lens.fy * along, lens.cx * across, lens.cy * along)

    def _cloud(self, raw: bytes) -> tuple[float, str, Picture]:
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
        picture = picture_of_cloud(cloud, self._source.fov)
        return message.header.stamp.to_sec(), message.header.frame_id, picture
