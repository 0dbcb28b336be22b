"""A colour camera: raw and compressed picture, camera info."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.simulator.cameras import encoding
from robots.simulator.cameras.clock_code import draw_clock
from robots.simulator.cameras.lens import HEAD_LENS, REAR_LENS, Lens
from robots.simulator.faults import Faults
from robots.simulator.joints.frames import OPTICAL_FRAME, Placed, camera_pose, frames, place
from robots.simulator.robot import Robot
from robots.simulator.ros_side import Publisher, RosSide, Stamp
from robots.simulator.sensors.body import Body, CameraMount
from robots.simulator.topics.cameras.drawing_thread import DrawingThread, Moment
from robots.simulator.topics.cameras.messages import anybody, camera_info

_WRONG_SIZE = Lens(100, 100, 50.0)


class CameraModel(NamedTuple):
    """One kind of camera: topic, frame, lens, pose, and whether it also sends compressed pictures."""

    topic: str
    frame: str
    lens: Lens
    pose: Callable[[], Placed]
    compressed: bool = False
    clock: bool = False  # draws the clock code
    breaks: bool = False  # has the faults named camera_


def head_camera(robot: Robot, *, clock: bool) -> CameraModel:
    """Return the head's camera, as on TIAGo."""
    return CameraModel(
        "/xtion/rgb",
        OPTICAL_FRAME,
        HEAD_LENS,
        lambda: camera_pose(robot.player.positions),
        compressed=True,
        clock=clock,
        breaks=True,
    )


def rear_camera(body: Body, mount: CameraMount) -> CameraModel:
    """Return a camera that looks back, without compressed pictures."""
    placed = place(frames(body), mount.link, {})
    return CameraModel("/rear_camera", mount.optical_frame, REAR_LENS, lambda: placed)


class CameraPublisher:
    """Publishes the pictures of one colour camera."""

    def __init__(self, ros: RosSide, robot: Robot, thread: DrawingThread, model: CameraModel) -> None:
        self._ros = ros
        self._robot = robot
        self._thread = thread
        self._model = model
        self._raw = ros.publisher(f"{model.topic}/image_raw", "sensor_msgs/Image")
        self._publishers = [self._raw]
        self._compressed = None
        if model.compressed:
            topic = f"{model.topic}/image_raw/compressed"
            self._compressed = ros.publisher(topic, "sensor_msgs/CompressedImage")
            self._publishers.append(self._compressed)
        self._info = ros.publisher(f"{model.topic}/camera_info", "sensor_msgs/CameraInfo")
        self._publishers.append(self._info)
        self._number = 0
        self._requested_s = -math.inf
        self._last: list[tuple[Publisher, Any]] = []  # the messages of the last picture

    def publish(self, stamp: Stamp) -> None:
        """Request a picture, if it has subscribers."""
        faults, now_s = self._faults, time.monotonic()
        if not anybody(*self._publishers) or self._thread.blind or faults.camera_dead:
            return
        if faults.camera_rate_hz and now_s < self._requested_s + 1.0 / faults.camera_rate_hz:
            return
        self._requested_s = now_s
        self._thread.request(self, Moment(stamp, now_s, self._robot.physics.snapshot(), self._model.pose()))

    def draw_and_publish(self, thread: DrawingThread, moment: Moment) -> None:
        if not self._repeats():
            pixels = thread.colour(moment, self._model.lens)
            if pixels is None:
                return
            if self._model.clock:
                draw_clock(pixels, moment.monotonic_s)
            self._number += 1
            self._last = self._messages(pixels, moment)
        for publisher, message in self._last:
            publisher.publish(message)

    def _repeats(self) -> bool:
        """Return whether to repeat the last picture: the camera is frozen, and each used topic has it."""
        sent = [publisher for publisher, _ in self._last]
        return self._faults.camera_frozen and all(
            publisher in sent for publisher in self._publishers if publisher.wanted
        )

    @property
    def _faults(self) -> Faults:
        return self._robot.faults if self._model.breaks else Faults()

    def _messages(self, pixels: NDArray[np.uint8], moment: Moment) -> list[tuple[Publisher, Any]]:
        found: list[tuple[Publisher, Any]] = [(self._info, self._camera_info())]
        if self._raw.wanted:
            raw = encoding.raw(pixels, self._number, self._faults)
            message = self._ros.new(
                "sensor_msgs/Image",
                height=raw.height,
                width=raw.width,
                encoding=raw.encoding,
                step=raw.step,
                data=self._ros.octets(raw.data),
            )
            found.append((self._raw, message))
        if self._compressed is not None and self._compressed.wanted:
            kind, data = encoding.compressed(pixels, self._number, self._faults)
            message = self._ros.new(
                "sensor_msgs/CompressedImage",
                format=f"rgb8; {kind} compressed bgr8",
                data=self._ros.octets(data),
            )
            found.append((self._compressed, message))
        for _, message in found:
            self._ros.stamped(message, moment.stamp, self._model.frame)
        return found

    def _camera_info(self) -> Any:
        """Return the camera info; with the fault, in turn: zeros (not calibrated), another size, nan."""
        info = camera_info(self._ros, self._model.lens)
        if self._faults.camera_info_wrong:
            match self._number % 3:
                case 0:
                    self._ros.calibrated(info, k=[0.0] * 9, p=[0.0] * 12)
                case 1:
                    info = camera_info(self._ros, _WRONG_SIZE)
                case 2:
                    self._ros.calibrated(info, k=[math.nan] * 9, p=[math.nan] * 12)
        return info
