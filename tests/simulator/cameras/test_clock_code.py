"""The time in a picture can be read again, also from a smaller or compressed picture."""

from __future__ import annotations

import io

import numpy as np
import PIL.Image
import pytest

from robots.simulator.cameras.clock_code import draw_clock
from tests.simulator.cameras.clock_reader import read_clock

NOISE = np.random.default_rng(0).integers(0, 256, (480, 640, 3), dtype=np.uint8)


def with_clock(monotonic_s: float) -> PIL.Image.Image:
    pixels = NOISE.copy()
    draw_clock(pixels, monotonic_s)
    return PIL.Image.fromarray(pixels)


@pytest.mark.parametrize("size", [(640, 480), (320, 240)])
@pytest.mark.parametrize("monotonic_s", [0.0, 1.0001, 123456.7891, 2**32 / 1e4 - 1e-4])
def test_the_time_survives_a_bad_jpeg_and_half_the_size(monotonic_s, size):
    written = io.BytesIO()
    with_clock(monotonic_s).resize(size).save(written, "JPEG", quality=30)
    read = read_clock(np.asarray(PIL.Image.open(written)))
    assert read == pytest.approx(monotonic_s, abs=1e-6)


def test_the_time_begins_again_after_five_days():
    assert read_clock(np.asarray(with_clock(2**32 / 1e4 + 7.0))) == pytest.approx(7.0)


@pytest.mark.parametrize("fill", [0, 255])
def test_an_even_picture_has_no_time(fill):
    assert read_clock(np.full_like(NOISE, fill)) is None


@pytest.mark.parametrize("block", range(40))
def test_one_wrong_block_makes_the_code_invalid(block):
    pixels = np.array(with_clock(123456.7891))
    pixels[:16, 16 * block : 16 * block + 16] ^= 255
    assert read_clock(pixels) is None
