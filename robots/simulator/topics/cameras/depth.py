"""The head's depth camera: picture, camera info, point cloud."""

from __future__ import annotations

import time
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robots.simulator.cameras.lens import HEAD_LENS
from robots.simulator.joints.frames import OPTICAL_FRAME, camera_pose
from robots.simulator.robot import Robot
from robots.simulator.ros_side import RosSide, Stamp
from robots.simulator.sensors.depth import DepthCamera, as_millimetres
from robots.simulator.topics.cameras.drawing_thread import DrawingThread, Moment
from robots.simulator.topics.cameras.messages import anybody, camera_info

FLOAT32 = 7  # datatype of sensor_msgs/PointField


class DepthPublisher:
    """Publishes depth as 32FC1 or 16UC1."""

    def __init__(self, ros: RosSide, robot: Robot, thread: DrawingThread, encoding: str) -> None:
        self._ros = ros
        self._robot = robot
        self._thread = thread
        self._encoding = encoding
        topic = "/xtion/depth_registered"
        self._image = ros.publisher(f"{topic}/image_raw", "sensor_msgs/Image")
        self._info = ros.publisher(f"{topic}/camera_info", "sensor_msgs/CameraInfo")
        self._cloud = ros.publisher(f"{topic}/points", "sensor_msgs/PointCloud2")
        self._camera = DepthCamera(np.random.default_rng(0))

    def publish(self, stamp: Stamp) -> None:
        """Request a picture, if it has subscribers."""
        if anybody(self._image, self._info, self._cloud) and not self._robot.faults.depth_dead:
            pose = camera_pose(self._robot.player.positions)
            self._thread.request(self, Moment(stamp, time.monotonic(), self._robot.physics.snapshot(), pose))

    def draw_and_publish(self, thread: DrawingThread, moment: Moment) -> None:
        """Measure and publish, on the drawing thread."""
        depth = self._camera.image(thread.reader, moment.camera)
        pixels = as_millimetres(depth) if self._encoding == "16UC1" else depth
        stamped = partial(self._ros.stamped, stamp=moment.stamp, frame=OPTICAL_FRAME)
        self._image.publish(stamped(self._image_message(pixels)))
        self._info.publish(stamped(camera_info(self._ros, HEAD_LENS)))
        if self._cloud.wanted:
            self._cloud.publish(stamped(self._point_cloud(self._camera.points(depth))))

    def _image_message(self, pixels: NDArray[np.generic]) -> Any:
        height, width = pixels.shape
        data = pixels.tobytes()
        return self._ros.new(
            "sensor_msgs/Image",
            height=height,
            width=width,
            encoding=self._encoding,
            step=len(data) // height,
            data=self._ros.octets(data),
        )

    def _point_cloud(self, points: NDArray[np.float32]) -> Any:
        """Return an organised cloud; points without a measurement are NaN."""
        height, width, _ = points.shape
        size = points.itemsize
        fields = [
            self._ros.new("sensor_msgs/PointField", name=name, offset=size * index, datatype=FLOAT32, count=1)
            for index, name in enumerate(("x", "y", "z"))
        ]
        return self._ros.new(
            "sensor_msgs/PointCloud2",
            height=height,
            width=width,
            point_step=3 * size,
            row_step=3 * size * width,
            fields=fields,
            data=self._ros.octets(points.tobytes()),
        )
