"""The head's depth camera: picture, camera info, point cloud."""

from __future__ import annotations

import time

import numpy as np
import rospy
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, PointField

from robots.simulator.cameras.lens import HEAD_LENS
from robots.simulator.joints.frames import OPTICAL_FRAME, camera_pose
from robots.simulator.robot import Robot
from robots.simulator.ros.cameras.drawing_thread import DrawingThread, Moment
from robots.simulator.ros.cameras.messages import anybody, camera_info
from robots.simulator.ros.messages import stamped
from robots.simulator.sensors.depth import DepthCamera, as_millimetres


class DepthPublisher:
    """Publishes depth as 32FC1 or 16UC1."""

    def __init__(self, robot: Robot, thread: DrawingThread, encoding: str) -> None:
        self._robot = robot
        self._thread = thread
        self._encoding = encoding
        self._image = rospy.Publisher("/xtion/depth_registered/image_raw", Image, queue_size=1)
        self._info = rospy.Publisher("/xtion/depth_registered/camera_info", CameraInfo, queue_size=1)
        self._cloud = rospy.Publisher("/xtion/depth_registered/points", PointCloud2, queue_size=1)
        self._camera = DepthCamera(np.random.default_rng(0))

    def publish(self, stamp: rospy.Time) -> None:
        """Request a picture, if it has subscribers."""
        if anybody(self._image, self._info, self._cloud) and not self._robot.faults.depth_dead:
            pose = camera_pose(self._robot.player.positions)
            self._thread.request(self, Moment(stamp, time.monotonic(), self._robot.physics.snapshot(), pose))

    def draw_and_publish(self, thread: DrawingThread, moment: Moment) -> None:
        """Measure and publish, on the drawing thread."""
        depth = self._camera.image(thread.reader, moment.camera)
        pixels = as_millimetres(depth) if self._encoding == "16UC1" else depth
        self._image.publish(stamped(_image(self._encoding, pixels), moment.stamp, OPTICAL_FRAME))
        self._info.publish(stamped(camera_info(HEAD_LENS), moment.stamp, OPTICAL_FRAME))
        if self._cloud.get_num_connections():
            cloud = _point_cloud(self._camera.points(depth))
            self._cloud.publish(stamped(cloud, moment.stamp, OPTICAL_FRAME))


def _image(encoding: str, pixels: NDArray[np.generic]) -> Image:
    height, width = pixels.shape
    data = pixels.tobytes()
    return Image(height=height, width=width, encoding=encoding, step=len(data) // height, data=data)


def _point_cloud(points: NDArray[np.float32]) -> PointCloud2:
    """Return an organised cloud; points without a measurement are NaN."""
    height, width, _ = points.shape
    size = points.itemsize
    message = PointCloud2(height=height, width=width, point_step=3 * size, row_step=3 * size * width)
    message.fields = [
        PointField(name, size * index, PointField.FLOAT32, 1) for index, name in enumerate(("x", "y", "z"))
    ]
    message.data = points.tobytes()
    return message
