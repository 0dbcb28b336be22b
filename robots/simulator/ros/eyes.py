"""The head camera's topics, rendered on a separate thread, only while they have subscribers."""

from __future__ import annotations

import contextlib
import io
import logging
import queue
import threading
from typing import NamedTuple

import numpy as np
import PIL.Image
import rospy
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2, PointField

from robots.simulator.joints.frames import OPTICAL_FRAME
from robots.simulator.joints.joint_table import CameraPose, camera_pose
from robots.simulator.physics.mujoco_world import Onlooker, Snapshot
from robots.simulator.robot import Robot
from robots.simulator.sensors.camera import Camera, NoCameraError
from robots.simulator.sensors.depth import FOCAL_PX, HEIGHT, WIDTH, DepthCamera, as_millimetres

log = logging.getLogger(__name__)

_JPEG_QUALITY = 80


class Moment(NamedTuple):
    """A snapshot of the world for the drawing thread."""

    stamp: rospy.Time
    snapshot: Snapshot
    camera: CameraPose
    in_colour: bool


class Eyes:
    """Depth at 10 Hz, colour at 5 Hz."""

    def __init__(self, robot: Robot, depth_encoding: str) -> None:
        self._robot = robot
        self._encoding = depth_encoding
        self._depth = _image_publisher("/xtion/depth_registered/image_raw")
        self._depth_info = _info_publisher("/xtion/depth_registered/camera_info")
        self._cloud = rospy.Publisher("/xtion/depth_registered/points", PointCloud2, queue_size=1)
        self._rgb = _image_publisher("/xtion/rgb/image_raw")
        self._rgb_info = _info_publisher("/xtion/rgb/camera_info")
        self._compressed = rospy.Publisher("/xtion/rgb/image_raw/compressed", CompressedImage, queue_size=1)
        self._moments: queue.Queue[Moment | None] = queue.Queue(maxsize=1)
        self._depth_camera = DepthCamera(np.random.default_rng(0))
        self._camera: Camera | None = None
        self._blind = False
        self._thread = threading.Thread(target=self._look, name="eyes", daemon=True)
        self._thread.start()

    def publish_depth(self, stamp: rospy.Time) -> None:
        """Take a depth picture, if it has subscribers."""
        if _anybody(self._depth, self._depth_info, self._cloud) and not self._robot.faults.depth_dead:
            self._see(stamp, in_colour=False)

    def publish_rgb(self, stamp: rospy.Time) -> None:
        """Take a colour picture, if it has subscribers."""
        if _anybody(self._rgb, self._rgb_info, self._compressed) and not self._blind:
            self._see(stamp, in_colour=True)

    def close(self) -> None:
        """End the thread; only it can release the camera's context."""
        with contextlib.suppress(queue.Full):  # the thread is dead or blocked
            self._moments.put(None, timeout=1.0)
        self._thread.join(timeout=2.0)

    def _see(self, stamp: rospy.Time, in_colour: bool) -> None:
        pose = camera_pose(self._robot.player.positions)
        moment = Moment(stamp, self._robot.physics.snapshot(), pose, in_colour)
        # Still busy with the last picture: this one is skipped, as by a loaded camera driver.
        with contextlib.suppress(queue.Full):
            self._moments.put_nowait(moment)

    def _look(self) -> None:
        onlooker = Onlooker(self._robot.physics)
        while (moment := self._moments.get()) is not None:
            onlooker.follow(moment.snapshot)
            if moment.in_colour:
                self._tell_colour(onlooker, moment)
            else:
                self._tell_depth(onlooker, moment)
        if self._camera is not None:
            self._camera.close()

    def _tell_depth(self, onlooker: Onlooker, moment: Moment) -> None:
        depth = self._depth_camera.image(onlooker, moment.camera)
        pixels = as_millimetres(depth) if self._encoding == "16UC1" else depth
        self._depth.publish(_image(moment.stamp, self._encoding, pixels))
        self._depth_info.publish(_camera_info(moment.stamp))
        if self._cloud.get_num_connections():
            self._cloud.publish(_point_cloud(moment.stamp, self._depth_camera.points(depth)))

    def _tell_colour(self, onlooker: Onlooker, moment: Moment) -> None:
        if self._camera is None:
            try:
                self._camera = Camera(onlooker)
            except NoCameraError as error:
                self._blind = True
                log.warning("no colour camera on this machine: %s", error)
                return
        pixels = self._camera.image(moment.camera)
        if self._rgb.get_num_connections():
            self._rgb.publish(_image(moment.stamp, "rgb8", pixels))
        if self._compressed.get_num_connections():
            message = CompressedImage(format="rgb8; jpeg compressed bgr8", data=_jpeg(pixels))
            message.header.stamp = moment.stamp
            message.header.frame_id = OPTICAL_FRAME
            self._compressed.publish(message)
        self._rgb_info.publish(_camera_info(moment.stamp))


def _image_publisher(topic: str) -> rospy.Publisher:
    return rospy.Publisher(topic, Image, queue_size=1)


def _info_publisher(topic: str) -> rospy.Publisher:
    return rospy.Publisher(topic, CameraInfo, queue_size=1)


def _anybody(*publishers: rospy.Publisher) -> bool:
    return any(publisher.get_num_connections() for publisher in publishers)


def _jpeg(pixels: NDArray[np.uint8]) -> bytes:
    written = io.BytesIO()
    PIL.Image.fromarray(pixels).save(written, "JPEG", quality=_JPEG_QUALITY)
    return written.getvalue()


def _image(stamp: rospy.Time, encoding: str, pixels: NDArray[np.generic]) -> Image:
    message = Image(height=HEIGHT, width=WIDTH, encoding=encoding, data=pixels.tobytes())
    message.step = len(message.data) // HEIGHT
    message.header.stamp = stamp
    message.header.frame_id = OPTICAL_FRAME
    return message


def _point_cloud(stamp: rospy.Time, points: NDArray[np.float32]) -> PointCloud2:
    """Return an organised cloud; points without a measurement are NaN."""
    height, width, _ = points.shape
    size = points.itemsize
    message = PointCloud2(height=height, width=width, point_step=3 * size, row_step=3 * size * width)
    message.fields = [
        PointField(name, size * index, PointField.FLOAT32, 1) for index, name in enumerate(("x", "y", "z"))
    ]
    message.data = points.tobytes()
    message.header.stamp = stamp
    message.header.frame_id = OPTICAL_FRAME
    return message


def _camera_info(stamp: rospy.Time) -> CameraInfo:
    """Return the camera info of a pinhole without distortion."""
    cx, cy = WIDTH / 2.0, HEIGHT / 2.0
    message = CameraInfo(height=HEIGHT, width=WIDTH, distortion_model="plumb_bob", D=[0.0] * 5)
    message.K = [FOCAL_PX, 0.0, cx, 0.0, FOCAL_PX, cy, 0.0, 0.0, 1.0]
    message.R = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    message.P = [FOCAL_PX, 0.0, cx, 0.0, 0.0, FOCAL_PX, cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    message.header.stamp = stamp
    message.header.frame_id = OPTICAL_FRAME
    return message
