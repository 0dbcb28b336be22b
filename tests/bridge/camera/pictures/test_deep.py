"""Pictures of depth and heat are stretched between percentiles, and their scale is told."""

from __future__ import annotations

import io
import struct
from zlib import compress, crc32

import numpy as np
import PIL.Image
import pytest

from robots.bridge.camera.pictures.deep import DARKEST, EVEN, is_deep, raw_deep, stretched
from robots.bridge.camera.pictures.image_header import Damaged
from robots.bridge.camera.pictures.jpeg import decoded, small
from robots.bridge.camera.pictures.shown import compressed_picture
from robots.shared.wire import PictureScale

WIDTH, HEIGHT = 64, 48
DEPTH, HEAT = "/xtion/depth/image_raw", "/thermal/image_raw"
RAMP_MM = np.linspace(400, 3200, WIDTH * HEIGHT).reshape(HEIGHT, WIDTH)


def png(values):
    written = io.BytesIO()
    PIL.Image.fromarray(values.astype(np.uint16)).save(written, "PNG")
    return written.getvalue()


def raw(values, encoding, kind, is_depth=True, big_endian=False, padding=0):
    rows = values.astype((">" if big_endian else "<") + kind)
    data = b"".join(row.tobytes() + b"\x07" * padding for row in rows)
    return raw_deep(WIDTH, HEIGHT, encoding, big_endian, len(data) // HEIGHT, data, is_depth)


def ends(scale):
    return (scale.low, scale.high, scale.unit)


METRES = (pytest.approx(0.456, abs=0.01), pytest.approx(3.144, abs=0.01), "m")


@pytest.mark.parametrize("big_endian", [False, True])
@pytest.mark.parametrize(
    ("encoding", "kind", "per_m"),
    [
        ("mono16", "u2", 1000),
        ("16UC1", "u2", 1000),
        ("16SC1", "i2", 1000),
        ("TYPE_16UC1", "u2", 1000),
        ("32FC1", "f4", 1),
        ("TYPE_32FC1", "f4", 1),
        ("64FC1", "f8", 1),
    ],
)
def test_depth_is_stretched_in_metres_whatever_its_encoding(encoding, kind, per_m, big_endian):
    image, scale = raw(RAMP_MM / 1000 * per_m, encoding, kind, big_endian=big_endian, padding=6)
    assert ends(scale) == METRES
    grey = np.asarray(image)
    assert (grey[0, 0], grey[-1, -1]) == (DARKEST, 255)
    assert grey[24, 0] == pytest.approx((DARKEST + 255) / 2, abs=4)


@pytest.mark.parametrize("bad", [0.0, np.nan, np.inf, -np.inf, -1.0, 1e39])
def test_what_was_not_measured_is_black_and_no_end_of_the_scale(bad):
    metres = RAMP_MM / 1000
    metres[:20] = bad
    image, scale = raw(metres, "64FC1", "f8")
    assert not np.asarray(image)[:20].any()
    assert np.asarray(image)[20:].min() >= DARKEST
    assert scale.low > 1.5


def test_depth_without_an_echo_is_black():
    millimetres = RAMP_MM.copy()
    millimetres[:, :20] = 65535
    image, scale = raw(millimetres, "16UC1", "u2")
    assert scale.high < 3.2
    assert not np.asarray(image)[:, :20].any()


def test_a_picture_without_any_value_says_so():
    image, scale = raw(np.full((HEIGHT, WIDTH), np.nan), "32FC1", "f4")
    assert ends(scale) == (None, None, "m")
    assert not np.asarray(image).any()


def test_equal_values_are_an_even_grey():
    image, scale = raw(np.full((HEIGHT, WIDTH), 29_315), "mono16", "u2", is_depth=False)
    assert ends(scale) == (29_320, 29_320, "")
    assert set(np.asarray(image).ravel()) == {EVEN}


@pytest.mark.parametrize("hot", [65_535, 1])
def test_one_hot_pixel_changes_nothing(hot):
    heat = np.random.default_rng(1).integers(29_000, 31_000, (HEIGHT, WIDTH))
    calm = raw(heat, "16UC1", "u2", is_depth=False)
    heat[7, 7] = hot
    image, scale = raw(heat, "16UC1", "u2", is_depth=False)
    assert abs(scale.low - calm[1].low) <= 10 and abs(scale.high - calm[1].high) <= 10
    assert np.abs(np.asarray(image, int) - np.asarray(calm[0], int)).ravel()[:400].max() <= 2
    assert (scale.low, scale.unit) == (pytest.approx(29_040, abs=30), "")


@pytest.mark.parametrize("encoding", ["bayer_rggb16", "bayer_gbrg16"])
def test_a_pattern_of_16_bits_is_grey(encoding):
    image, _ = raw(RAMP_MM, encoding, "u2", is_depth=False)
    assert np.asarray(image).std() > 50


def test_colours_of_16_bits_keep_their_order():
    pixels = np.zeros((HEIGHT, WIDTH, 3), "<u2")
    pixels[:, : WIDTH // 2] = (100, 2000, 4000)
    pixels[:, WIDTH // 2 :] = (4000, 2000, 100)
    for encoding in ("rgb16", "bgr16"):
        image, _ = raw_deep(WIDTH, HEIGHT, encoding, False, WIDTH * 6, pixels.tobytes(), False)
        red, _, blue = np.asarray(image)[0, 0]
        assert (red < blue) == (encoding == "rgb16")


@pytest.mark.parametrize("encoding", ["mono8", "8UC1", "rgb8", "32FC3", ""])
def test_other_encodings_are_not_stretched(encoding):
    assert not is_deep(encoding)


def test_bytes_that_do_not_fit_are_refused():
    with pytest.raises(Damaged, match="need more"):
        raw_deep(WIDTH, HEIGHT, "32FC1", False, WIDTH * 2, bytes(WIDTH * HEIGHT * 2), True)


def looks(encoded):
    """The picture in large and in small."""
    image = decoded(encoded, WIDTH)
    return np.asarray(image.convert("L"), float), np.asarray(decoded(small(image), WIDTH).convert("L"), float)


@pytest.mark.parametrize("form", ["16UC1; png compressed ", "png", "PNG", "", "jpeg"])
def test_a_png_of_16_bits_is_alike_at_every_size(form):
    shown = compressed_picture(png(RAMP_MM) + b"\0" * 9, form, DEPTH)
    assert (shown.format, shown.width, shown.height) == ("jpeg", WIDTH, HEIGHT)
    assert ends(shown.scale) == METRES
    large, little = looks(shown.encoded)
    assert abs(large.mean() - little.mean()) < 3
    assert large[0].mean() < 40 and large[-1].mean() > 240


@pytest.mark.parametrize(("kind", "count"), [(2, 3), (4, 2), (6, 4)], ids=["colour", "grey", "colour, alpha"])
def test_other_pngs_of_16_bits_are_stretched_too(kind, count):
    """Pillow keeps the upper 8 bits of these; alpha is left out."""

    def chunk(name, content):
        return struct.pack(">I", len(content)) + name + content + struct.pack(">I", crc32(name + content))

    values = np.repeat(RAMP_MM[:, :, None], count, axis=2).astype(">u2")
    values[:, :, 3 if count == 4 else 1] = 65_535 if count != 3 else values[:, :, 1]
    rows = b"".join(b"\0" + row.tobytes() for row in values)
    header = struct.pack(">IIBBBBB", WIDTH, HEIGHT, 16, kind, 0, 0, 0)
    chunks = chunk(b"IHDR", header) + chunk(b"IDAT", compress(rows)) + chunk(b"IEND", b"")
    shown = compressed_picture(b"\x89PNG\r\n\x1a\n" + chunks, "png", HEAT)
    assert ends(shown.scale) == (pytest.approx(456, abs=2), pytest.approx(3144, abs=2), "")
    large, _ = looks(shown.encoded)
    assert large[0].mean() < 40 and large[-1].mean() > 240


def test_heat_has_the_sensors_own_numbers():
    assert ends(compressed_picture(png(RAMP_MM), "png", HEAT).scale) == (455.4, 3144, "")


@pytest.mark.parametrize(
    "form", ["16UC1; compressedDepth png", "16UC1; compressedDepth", "16UC1;compressedDepth PNG"]
)
def test_the_transport_for_depth_is_read(form):
    data = struct.pack("<iff", 0, 0.0, 0.0) + png(RAMP_MM)
    assert ends(compressed_picture(data, form, "/camera/range").scale) == METRES


def test_the_transports_inverse_depth_is_read():
    a, b = 1000.0, 0.5
    inverse = np.rint(a / (RAMP_MM / 1000) + b)
    inverse[:5] = 0  # nothing was measured
    data = struct.pack("<iff", 0, a, b) + png(inverse)
    scale = compressed_picture(data, "32FC1; compressedDepth png", DEPTH).scale
    assert (scale.low, scale.high) == (pytest.approx(0.74, abs=0.05), pytest.approx(3.15, abs=0.02))


@pytest.mark.parametrize(
    ("data", "form", "words"),
    [
        (bytes(5000), "16UC1; compressedDepth rvl", "RVL"),
        (bytes(12), "16UC1; compressedDepth png", "is cut off"),
        (bytes(5000), "16UC1; compressedDepth png", "is neither JPEG nor PNG"),
        (bytes(12) + png(RAMP_MM)[:-30], "16UC1; compressedDepth png", "is cut off"),
    ],
)
def test_what_the_transport_for_depth_cannot_show_is_said(data, form, words):
    with pytest.raises(Damaged, match=words):
        compressed_picture(data, form, DEPTH)


def test_a_large_picture_takes_little_time():
    stretched(np.zeros((1080, 1920), np.uint16), False)
    image, scale = stretched(np.full((1080, 1920), 7.0), True)
    assert (image.size, scale) == ((1920, 1080), PictureScale(7.0, 7.0, "m"))
