"""The simulated robot's colour cameras on ROS: rates, the clock code, the rear camera, and faults."""

from __future__ import annotations

import io
import time

import numpy as np
import PIL.Image
import pytest
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from tf2_msgs.msg import TFMessage

from robots.simulator.cameras.clock_code import TICKS_PER_S
from tests.processes import until
from tests.simulator.cameras.clock_reader import read_clock

HEAD = "/xtion/rgb/image_raw/compressed"


@pytest.fixture(scope="module", autouse=True)
def robot(ros, simulator):
    robot = simulator(pose="2,1.8,0", seed=1, rear_camera=True, camera_clock=True)
    blind = "no colour camera on this machine"
    with ros.listen(HEAD, CompressedImage) as pictures:
        until(lambda: pictures.drain() or blind in robot.log.read_text(), "a picture")
    if blind in robot.log.read_text():
        pytest.skip(blind)
    return robot


def pixels(message: CompressedImage) -> np.ndarray:
    return np.asarray(PIL.Image.open(io.BytesIO(message.data)))


def test_the_head_sends_jpegs_of_its_size_with_its_lens(ros):
    with (
        ros.listen(HEAD, CompressedImage) as pictures,
        ros.listen("/xtion/rgb/camera_info", CameraInfo) as infos,
    ):
        picture, info = pictures.next(), infos.next()
    assert pixels(picture).shape == (480, 640, 3)
    assert (info.width, info.height, info.K[2], info.K[5]) == (640, 480, 320.0, 240.0)
    assert picture.header.frame_id == info.header.frame_id == "xtion_rgb_optical_frame"


def test_each_picture_tells_when_it_was_taken(ros):
    with ros.listen(HEAD, CompressedImage) as pictures:
        pictures.settle()
        message = pictures.next()
    age_s = (time.monotonic() - read_clock(pixels(message))) % (2**32 / TICKS_PER_S)
    by_stamp_s = time.time() - message.header.stamp.to_sec()
    assert age_s == pytest.approx(by_stamp_s, abs=0.05)


def test_fifteen_pictures_a_second_beside_ten_of_depth(ros):
    with (
        ros.listen(HEAD, CompressedImage) as colour,
        ros.listen("/xtion/depth_registered/image_raw", Image) as depth,
    ):
        colour.settle()
        depth.settle()
        stamps = [[inbox.next().header.stamp.to_sec() for _ in range(40)] for inbox in (colour, depth)]
    rates = [(len(times) - 1) / (times[-1] - times[0]) for times in stamps]
    assert rates == pytest.approx([15.0, 10.0], rel=0.2)


def test_the_rear_camera_sends_raw_pictures_in_a_known_frame(ros):
    with (
        ros.listen("/rear_camera/image_raw", Image) as pictures,
        ros.listen("/rear_camera/camera_info", CameraInfo) as infos,
        ros.listen("/tf_static", TFMessage) as fixed,
    ):
        picture, info = pictures.next(), infos.next()
        parents = {frame.child_frame_id: frame.header.frame_id for frame in fixed.next().transforms}
    assert (
        (picture.width, picture.height, picture.encoding)
        == (info.width, info.height, "rgb8")
        == (320, 240, "rgb8")
    )
    assert picture.step * picture.height == len(picture.data)
    assert parents[parents[picture.header.frame_id]] == "base_link"


def test_a_dead_camera_is_silent_and_the_other_goes_on(ros, fault):
    with ros.listen(HEAD, CompressedImage) as head, ros.listen("/rear_camera/image_raw", Image) as rear:
        head.next()
        fault("camera_dead")
        rear.settle()
        head.drain()
        rear.settle()
        assert head.drain() == []


def test_a_frozen_camera_repeats_a_picture_with_its_stamp(ros, fault):
    with ros.listen(HEAD, CompressedImage) as pictures:
        fault("camera_frozen")
        pictures.settle()
        first, second = pictures.next(), pictures.next()
    assert first.header.stamp == second.header.stamp
    assert first.data == second.data


def test_a_camera_can_become_slow(ros, fault):
    with ros.listen(HEAD, CompressedImage) as pictures:
        fault("camera_rate_hz=3")
        pictures.settle()
        first, second = (pictures.next().header.stamp.to_sec() for _ in range(2))
    assert second - first >= 0.3


def test_a_camera_can_change_its_encoding(ros, fault):
    with ros.listen(HEAD, CompressedImage) as pictures:
        fault("camera_encoding_changes")
        formats = {
            pictures.until(lambda message, kind=kind: kind in message.format).format
            for kind in ("jpeg", "png")
        }
    assert len(formats) == 2


def test_wrong_camera_info_is_zeros_another_size_and_nan(ros, fault):
    with ros.listen("/xtion/rgb/camera_info", CameraInfo) as infos:
        fault("camera_info_wrong")
        infos.until(lambda info: info.K[0] == 0.0)
        infos.until(lambda info: (info.width, info.height) == (100, 100))
        infos.until(lambda info: np.isnan(info.K[0]))
