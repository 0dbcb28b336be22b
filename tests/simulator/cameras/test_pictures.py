"""Pictures of the colour cameras: what they show, and how a broken camera damages them."""

from __future__ import annotations

import io
import math
from dataclasses import replace

import numpy as np
import PIL.Image
import pytest

from robots.simulator.cameras import encoding
from robots.simulator.cameras.drawing import Drawing, NoCameraError
from robots.simulator.cameras.lens import HEAD_LENS
from robots.simulator.faults import parse_faults
from robots.simulator.joints.frames import camera_pose, frames, place
from robots.simulator.joints.joint_table import HOME
from robots.simulator.physics.mujoco_world import Pose, WorldReader
from robots.simulator.sensors.body import REAR_CAMERA, TIAGO
from robots.simulator.worlds import Box
from tests.simulator.conftest import room

PIXELS = np.random.default_rng(0).integers(0, 256, (480, 640, 3), dtype=np.uint8)


@pytest.fixture
def picture(robot_in):
    """``picture(world, pose)``: the head camera's picture there."""

    def draw(world, pose):
        reader = WorldReader((robot := robot_in(world, pose).robot).physics)
        reader.follow(robot.physics.snapshot())
        try:
            drawing = Drawing(reader)
        except NoCameraError as error:
            pytest.skip(str(error))
        pixels = drawing.image(camera_pose(HOME), HEAD_LENS)
        drawing.close()
        return pixels

    return draw


def test_a_colour_picture_shows_a_coloured_thing_where_it_is(picture):
    red = Box(name="red", at=(1.85, -0.5), size=(0.01, 0.4, 2.0), colour="#d01010")
    pixels = picture(room(boxes=[red]), Pose(0.0, 0.0, 0.0)).astype(int)
    is_red = pixels[240, :, 0] > 2 * pixels[240, :, 1]
    ahead = 1.845 - camera_pose(HOME).origin[0]
    edges = [320 + HEAD_LENS.focal_px * right / ahead for right in (0.3, 0.7)]
    assert np.flatnonzero(is_red)[[0, -1]] == pytest.approx(edges, abs=2.0)


def test_no_camera_sees_through_a_wall_before_the_robot(picture):
    """The world is many metres long. The wall is near the hull (0.1 m), at an angle: a corner is nearer."""
    beyond = Box(name="beyond", at=(3.0, 0.0), size=(0.1, 9.0, 2.4), colour="#d01010")
    wall = Box(name="wall", at=(0.43, 0.0), size=(0.1, 9.0, 2.4), colour="#10d010")
    far = Box(name="far", at=(12.0, 0.0), size=(0.1, 9.0, 2.4))
    pixels = picture(room(boxes=[wall, beyond, far]), Pose(0.0, 0.0, 0.6)).astype(int)
    assert (pixels[200:280, :, 1] > pixels[200:280, :, 0]).all()


def test_only_the_colour_camera_sees_decoration(robot_in, picture):
    sign = Box(name="sign", at=(0.5, 0.0), size=(0.1, 3.0, 2.0), colour="#d01010")
    pose = Pose(0.0, 0.0, 0.0)
    physics = robot_in(room(decoration=[sign]), pose).robot.physics
    assert physics.contacts() == []
    assert physics.clearance_m() > 1.0
    ahead = physics.cast(np.array([0.0, 0.0, 1.0]), np.array([[1.0, 0.0, 0.0]]))
    assert ahead[0] == pytest.approx(2.0, abs=0.01)
    red, green, _ = picture(room(decoration=[sign]), pose)[240, 320].astype(int)
    assert red > 2 * green


def compressed(faults: str, number: int = 0) -> encoding.Encoded:
    return encoding.compressed(PIXELS, number, parse_faults(faults))


def size_and_kind(picture: encoding.Encoded) -> tuple[tuple[int, int], str]:
    PIL.Image.MAX_IMAGE_PIXELS = None
    with PIL.Image.open(io.BytesIO(picture.data)) as image:
        return image.size, str(image.format).lower()


def test_a_sound_picture_is_a_jpeg():
    assert size_and_kind(compressed("none")) == ((640, 480), "jpeg")


@pytest.mark.parametrize("fault", ["camera_corrupt", "camera_truncated"])
def test_damage_leaves_the_head_and_spoils_the_rest(fault):
    damaged = compressed(fault)
    assert damaged.data[:100] == compressed("none").data[:100]
    assert damaged.data != compressed("none").data
    with pytest.raises(OSError):
        PIL.Image.open(io.BytesIO(damaged.data)).load()


def test_a_huge_picture_declares_its_size_in_the_jpegs_head():
    assert size_and_kind(compressed("camera_huge")) == ((20000, 20000), "jpeg")


def test_a_bomb_is_a_small_file_with_many_pixels():
    bomb = compressed("camera_bomb")
    assert size_and_kind(bomb) == ((20000, 20000), "png")
    assert len(bomb.data) < 1_000_000


def test_a_changing_encoding_alternates():
    kinds = [compressed("camera_encoding_changes", number) for number in range(3)]
    assert [picture.format for picture in kinds] == ["jpeg", "png", "jpeg"]
    assert [size_and_kind(picture)[1] for picture in kinds] == ["jpeg", "png", "jpeg"]


@pytest.mark.parametrize("number", range(3))
def test_a_raw_picture_in_any_encoding_has_the_same_green(number):
    raw = encoding.raw(PIXELS, number, parse_faults("camera_encoding_changes"))
    assert raw.encoding == ("rgb8", "bgr8", "mono8")[number]
    pixels = np.frombuffer(raw.data, np.uint8).reshape(480, 640, -1)
    assert raw.step * raw.height == len(raw.data)
    np.testing.assert_array_equal(pixels[..., pixels.shape[2] // 2], PIXELS[..., 1])


@pytest.mark.parametrize(
    "fault", ["camera_zero", "camera_huge", "camera_bomb", "camera_corrupt", "camera_truncated"]
)
def test_a_damaged_raw_picture_contradicts_itself(fault):
    raw = encoding.raw(PIXELS, 0, parse_faults(fault))
    assert not raw.data or raw.step * raw.height != len(raw.data) or math.prod(raw[1:3]) > 1e8


def test_the_rear_camera_looks_back_and_down():
    axis = place(frames(replace(TIAGO, rear_camera=REAR_CAMERA)), REAR_CAMERA.optical_frame, {}).axes[:, 2]
    assert axis == pytest.approx([-0.906, 0.0, -0.423], abs=0.001)
