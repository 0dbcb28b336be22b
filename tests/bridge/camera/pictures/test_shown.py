"""A compressed picture ends where its format says: more bytes behind it, or no end at all, are no damage."""

from __future__ import annotations

import io
from types import SimpleNamespace

import numpy as np
import PIL.Image
import pytest

from robots.bridge.camera.pictures.image_header import LARGEST_BYTES, Damaged
from robots.bridge.camera.pictures.shown import compressed_picture, raw_picture

NOISE = PIL.Image.fromarray(np.random.default_rng(0).integers(0, 255, (96, 128, 3), dtype=np.uint8))


def saved(form="JPEG", image=NOISE, **options):
    written = io.BytesIO()
    image.save(written, form, **options)
    return written.getvalue()


PREVIEW = b"Exif\0\0" + saved(image=NOISE.resize((32, 24)))
PICTURES = {
    "baseline": saved(),
    "progressive": saved(progressive=True),
    "restarts": saved(restart_marker_blocks=3),
    "grey": saved(image=NOISE.convert("L")),
    "CMYK": saved(image=NOISE.convert("CMYK")),
    "preview": saved(exif=PREVIEW),
    "PNG": saved("PNG"),
}
PADDING = {
    "zeros": b"\0" * 5_000,
    "ones": b"\xff" * 5_000,
    "junk": np.random.default_rng(2).bytes(50_000),
    "another": saved(image=NOISE.resize((16, 16))),
    "much": b"\0" * (LARGEST_BYTES + 1),
    "text": b"\r\n--boundary--\r\n",
}


def shown(data, form="jpeg"):
    return compressed_picture(data, form, "/camera/compressed")


@pytest.mark.parametrize("padding", PADDING)
@pytest.mark.parametrize("name", PICTURES)
def test_bytes_behind_the_end_are_left_out(name, padding):
    picture = PICTURES[name]
    found = shown(picture + PADDING[padding])
    assert found.encoded == picture
    assert (found.width, found.height) == NOISE.size


@pytest.mark.parametrize("lost", [60, 900])
@pytest.mark.parametrize("name", PICTURES)
def test_a_cut_picture_is_told(name, lost):
    with pytest.raises(Damaged, match="is cut off"):
        shown(PICTURES[name][:-lost])


@pytest.mark.parametrize("padding", [b"", b"\0" * 700])
@pytest.mark.parametrize("name", [name for name in PICTURES if name != "PNG"])
def test_a_complete_jpeg_without_its_end_gets_one(name, padding):
    assert shown(PICTURES[name][:-2] + padding).encoded == PICTURES[name]


@pytest.mark.parametrize("lost", [60, 900])
def test_a_cut_picture_is_told_also_with_padding(lost):
    with pytest.raises(Damaged, match="is cut off"):
        shown(PICTURES["baseline"][:-lost] + b"\0" * 5_000)


@pytest.mark.parametrize(
    "form",
    ["jpeg", "bgr8; jpeg compressed bgr8", "rgb8; JPEG compressed bgr8", "jpg", "", "png", "x" * 5_000],
)
def test_the_words_of_the_format_do_not_matter(form):
    assert shown(PICTURES["baseline"], form).format == "jpeg"


def test_a_raw_image_without_a_row_length_is_shown():
    image = SimpleNamespace(width=4, height=2, encoding="mono8", step=0, data=bytes(8), is_bigendian=0)
    assert raw_picture(image, "/camera/image_raw").width == 4
