"""The pinhole model with which the robot's way is drawn into a camera's picture."""

import math
from types import SimpleNamespace

import pytest

from robots.bridge.camera.lens import Misfit, lens_of

RAW, RECTIFIED = "/xtion/rgb/image_raw/compressed", "/xtion/rgb/image_rect_color/compressed"
LENS = (525.0, 526.0, 320.0, 240.0)


def info(lens=LENS, *, width=640, height=480, bent=(0.0,) * 5, model="plumb_bob", projected=LENS):
    fx, fy, cx, cy = lens
    px, py, pcx, pcy = projected
    return SimpleNamespace(
        width=width,
        height=height,
        distortion_model=model,
        D=bent,
        K=(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0),
        P=(px, 0.0, pcx, 0.0, 0.0, py, pcy, 0.0, 0.0, 0.0, 1.0, 0.0),
    )


def test_a_smaller_picture_has_a_smaller_lens():
    assert lens_of(info(), 320, 240, RAW) == tuple(value / 2.0 for value in LENS)


def test_a_rectified_topic_has_the_lens_of_its_projection():
    projected = (500.0, 501.0, 310.0, 230.0)
    given = info(bent=(-0.4, 0.2, 0.0, 0.0, 0.0), projected=projected)
    assert lens_of(given, 640, 480, RECTIFIED) == projected
    with pytest.raises(Misfit, match="bends"):
        lens_of(given, 640, 480, "/director/image_raw")


def test_a_lens_as_of_a_calibrated_xtion_is_taken():
    assert lens_of(info(bent=(0.05, -0.12, 0.0, 0.001, 0.0)), 640, 480, RAW) == LENS


@pytest.mark.parametrize(
    "given",
    [
        info(bent=(-0.3, 0.1, 0.0, 0.0, 0.0)),
        info((300.0, 300.0, 320.0, 240.0), bent=(0.0,) * 4, model="equidistant"),
        info(bent=(math.nan, 0.0, 0.0, 0.0, 0.0)),
        info(bent=(0.5, -0.85, 0.0, 0.0, 0.0)),
    ],
    ids=["barrel", "fisheye", "no number", "both ways"],
)
def test_a_lens_that_bends_its_picture_draws_nothing(given):
    with pytest.raises(Misfit, match="bends"):
        lens_of(given, 640, 480, RAW)


@pytest.mark.parametrize(
    ("given", "why"),
    [
        (info(width=0), "0 x 480 pixels, not 640 x 480"),
        (info(height=400), "640 x 400 pixels, not 640 x 480"),
        (info((math.nan, *LENS[1:])), "not valid"),
        (info((0.0, *LENS[1:])), "not valid"),
    ],
    ids=["empty", "shape", "no number", "zero"],
)
def test_an_info_of_another_picture_draws_nothing(given, why):
    with pytest.raises(Misfit, match=why):
        lens_of(given, 640, 480, RAW)
