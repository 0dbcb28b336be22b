"""Raw images become JPEG; slow connections get small JPEG or H.264 that a decoder understands."""

import io

import av
import numpy as np
import PIL.Image
import pytest

from robots.bridge.camera.pictures.encoding import VIDEO_BITS_PER_S, VIDEO_HZ
from robots.bridge.camera.pictures.h264 import H264Encoder
from robots.bridge.camera.pictures.image_header import Damaged, read_header
from robots.bridge.camera.pictures.jpeg import decoded, jpeg, raw_image, small

WIDTH, HEIGHT = 64, 48
RED = (200, 30, 40)


def raw(encoding, channels, order=None, step=None):
    """Return a red picture in this encoding as `raw_image` takes it."""
    pixels = np.zeros((HEIGHT, WIDTH, channels), np.uint8)
    pixels[:] = [RED[place] if place < 3 else 255 for place in (order or range(channels))]
    return WIDTH, HEIGHT, encoding, step or WIDTH * channels, pixels.tobytes()


@pytest.mark.parametrize(
    "given",
    [
        raw("rgb8", 3),
        raw("bgr8", 3, (2, 1, 0)),
        raw("rgba8", 4, (0, 1, 2, 3)),
        raw("bgra8", 4, (2, 1, 0, 3)),
        raw("8UC4", 4, (2, 1, 0, 3)),
    ],
    ids=lambda given: given[2],
)
def test_colours_of_raw_images_are_kept(given):
    shown = PIL.Image.open(io.BytesIO(jpeg(raw_image(*given))))
    assert shown.size == (WIDTH, HEIGHT)
    assert np.abs(np.asarray(shown.convert("RGB"), int)[10, 10] - RED).max() < 12


def test_packed_colours_are_shown():
    grey = bytes([128, 90] * WIDTH * HEIGHT)  # no colour, luma 90
    image = raw_image(WIDTH, HEIGHT, "yuv422", 2 * WIDTH, grey)
    assert np.ptp(np.asarray(image)[5, 5]) <= 2


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ((0, 0, "rgb8", 0, b""), "no pixels"),
        ((20000, 20000, "rgb8", 60000, b""), "20000 x 20000 pixels"),
        ((64, 48, "rgb8", 192, b"x" * 100), "has 100 bytes"),
        ((64, 48, "rgb8", 10, b"x" * 10000), "need more"),
        ((64, 48, "32FC3", 256, b"x" * 20000), "'32FC3', which the console does not know"),
        ((63, 48, "yuv422", 126, b"x" * 20000), "odd side"),
        ((64, 47, "yuv422", 128, b"x" * 20000), "odd side"),
        ((64, 48, "mono8", 100, b"x" * (100 * 47 + 64)), "need more"),
    ],
)
def test_a_raw_image_that_does_not_fit_is_refused(given, reason):
    with pytest.raises(Damaged, match=reason):
        raw_image(*given)


def test_a_picture_that_is_no_picture_is_refused():
    with pytest.raises(Damaged, match="cannot be decoded"):
        decoded(b"\xff\xd8 nothing \xff\xd9", 100)


def moving(seconds):
    """Pictures of a square that crosses a noisy wall."""
    wall = np.random.default_rng(1).integers(90, 160, (480, 640, 3), np.uint8)
    for step in range(int(seconds * VIDEO_HZ)):
        picture = wall.copy()
        picture[200:280, 4 * step : 4 * step + 80] = RED
        yield PIL.Image.fromarray(picture)


def test_small_pictures_are_small():
    picture = next(moving(1.0))
    header = read_header(small(picture))
    assert (header.width, header.height) == (320, 240)
    assert len(small(picture)) < len(jpeg(picture)) / 4


def test_video_decodes_from_each_key_picture():
    video = H264Encoder()
    units = []
    for number, picture in enumerate(moving(2.0)):
        if number == 10:
            video.require_key()
        units.append(video.encode(picture))
    keys = [number for number, (_, is_key) in enumerate(units) if is_key]
    assert keys == [0, 10]
    decoder = av.CodecContext.create("h264", "r")
    frames = [frame for unit, _ in units[10:] for frame in decoder.decode(av.Packet(unit))]
    frames += decoder.decode(None)
    assert len(frames) == len(units) - 10
    assert (frames[0].width, frames[0].height) == (480, 360)


def test_video_keeps_to_its_share_of_a_slow_connection():
    video = H264Encoder()
    units = [len(video.encode(picture)[0]) for picture in moving(6.0)]
    assert sum(units[VIDEO_HZ:]) * 8 / 5.0 < 1.3 * VIDEO_BITS_PER_S
