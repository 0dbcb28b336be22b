"""A depth camera's topics: subscribed while somebody has control, and pictures made ready for the gate.

Pictures arrive on a thread of rospy's and are thinned out and placed there; what reaches the event loop is small. A
megabyte of pixels is copied by nobody but rospy.
"""

from __future__ import annotations

import logging
import threading
import time
from typing import Any, Protocol

import genpy
import rospy
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, PointField

from robots.bridge.config import DepthSource
from robots.bridge.gate.depth import Cloud, DepthImage, Lens, Picture, picture_of_cloud, picture_of_image
from robots.bridge.gate.depth_camera import Frame, frame_of
from robots.bridge.gate.scan import Malformed
from robots.bridge.gate.values import DepthView, Pose
from robots.bridge.ros.frames import MAP, ODOM, Frames, PoseUnknown

log = logging.getLogger(__name__)

BUFFER_BYTES = 1 << 20  # what is read at once: a picture has some hundred kilobytes to some megabytes
EARLY_SHARE = 0.8  # of the time between two pictures: one that comes a little early is not too many


class Taker(Protocol):
    """Who gets the pictures. Called on threads of rospy's."""

    def depth(self, frame: Frame, stamp_s: float, arrival_s: float) -> None:
        """A picture."""

    def bad_depth(self, why: str) -> None:
        """One that cannot be used."""


class DepthTopics:
    """The topics of one depth camera."""

    def __init__(self, source: DepthSource, view: DepthView, taker: Taker) -> None:
        self.subscribers: list[rospy.Subscriber] = []
        self._source = source
        self._view = view
        self._taker = taker
        self._frames = Frames(source.base_frame)
        self._info: tuple[int, int, Lens] | None = None  # width and height of the pictures that it is for
        self._taken_s = float("-inf")
        self._wanted = False
        self._ended = False
        self._turn = threading.Event()
        threading.Thread(target=self._follow, name="depth", daemon=True).start()

    def look(self, wanted: bool) -> None:
        """Listen, or leave the robot alone. Returns at once."""
        if wanted != self._wanted:
            self._wanted = wanted
            self._turn.set()

    def map_to_odom(self) -> Pose | None:
        """The odometry frame in the map's, if the robot tells it."""
        return self._frames.flat(ODOM, MAP)

    def close(self) -> None:
        """End the thread."""
        self._ended = True
        self._turn.set()

    def _follow(self) -> None:
        """Subscribing asks the master, so that it may take a while."""
        while not self._ended:
            self._turn.wait()
            self._turn.clear()
            if self._wanted and not self.subscribers:
                self.subscribers = self._subscribed()
            elif not self._wanted and self.subscribers:
                leaving, self.subscribers = self.subscribers, []
                for subscriber in leaving:
                    subscriber.unregister()
                self._frames = Frames(self._source.base_frame)  # what was told before is not where things are

    def _subscribed(self) -> list[rospy.Subscriber]:
        wanted = [
            ("/tf_static", lambda raw: self._frames.hear(raw, fixed=True)),
            ("/tf", lambda raw: self._frames.hear(raw, fixed=False)),
            (self._source.topic, self._receive),
        ]
        if self._source.info:
            wanted.append((self._source.info, self._learn))
        return [
            rospy.Subscriber(
                topic,
                rospy.AnyMsg,
                lambda message, take=take: take(message._buff),
                queue_size=1 if topic == self._source.topic else None,
                buff_size=BUFFER_BYTES,
                tcp_nodelay=True,
            )
            for topic, take in wanted
        ]

    # --- on rospy's threads ------------------------------------------------------------------------

    def _learn(self, raw: bytes) -> None:
        """Camera info comes with each picture and stays the same."""
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
            message = (PointCloud2 if self._is_cloud else Image)().deserialize(raw)
            stamp_s = message.header.stamp.to_sec()
            picture = self._cloud(message) if self._is_cloud else self._image(message)
            to_base = self._frames.place(message.header.frame_id.lstrip("/"), stamp_s)
            self._taker.depth(frame_of(picture, to_base, self._view), stamp_s, arrival_s)
        except (Malformed, PoseUnknown) as error:
            self._taker.bad_depth(str(error))
        except genpy.DeserializationError as error:
            self._taker.bad_depth(f"its messages cannot be read ({error})")

    @property
    def _is_cloud(self) -> bool:
        return self._source.type == "sensor_msgs/PointCloud2"

    def _image(self, message: Any) -> Picture:
        image = DepthImage(
            message.width,
            message.height,
            message.encoding,
            bool(message.is_bigendian),
            message.step,
            message.data,
        )
        return picture_of_image(image, self._lens(message.width, message.height))

    def _lens(self, width: int, height: int) -> Lens:
        """By the camera's own word, for pictures of this size; without it, by the profile's field of view."""
        if self._info is None or not (width and height):
            return Lens.seeing(self._source.fov, max(width, 1), max(height, 1))
        of_width, of_height, lens = self._info
        across, along = width / of_width, height / of_height
        return Lens(lens.fx * across, lens.fy * along, lens.cx * across, lens.cy * along)

    def _cloud(self, message: Any) -> Picture:
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
        return picture_of_cloud(cloud, self._source.fov)
