"""Format and size of a picture are read from its bytes; pictures that no browser may get are refused."""

import io

import PIL.Image
import pytest

from robots.bridge.camera.pictures.image_header import LARGEST_BYTES, Damaged, ImageHeader, read_header


def picture(form, size=(64, 48), **options):
    written = io.BytesIO()
    PIL.Image.new("RGB", size, "teal").save(written, form, **options)
    return written.getvalue()


@pytest.mark.parametrize(
    ("encoded", "header"),
    [
        (picture("JPEG"), ImageHeader("jpeg", 64, 48)),
        (picture("JPEG", progressive=True), ImageHeader("jpeg", 64, 48)),
        (picture("JPEG", exif=b"Exif\0\0" + b"x" * 2000), ImageHeader("jpeg", 64, 48)),
        (picture("JPEG") + b"\0" * 10, ImageHeader("jpeg", 64, 48)),
        (picture("PNG"), ImageHeader("png", 64, 48)),
    ],
)
def test_format_and_size_are_read_without_decoding(encoded, header):
    assert read_header(encoded) == header
    assert read_header(memoryview(encoded)) == header


def wide(encoded, at, big=b"\x4e\x20\x4e\x20"):
    """Return the picture with a declared size of 20000 x 20000."""
    return encoded[:at] + big + encoded[at + len(big) :]


def start_of_frame(encoded):
    return encoded.index(b"\xff\xc0") + 5


@pytest.mark.parametrize(
    ("encoded", "reason"),
    [
        (b"", "is neither JPEG nor PNG"),
        (b"GIF89a" + b"\0" * 50, "is neither JPEG nor PNG"),
        (picture("JPEG")[:200], "is cut off"),
        (picture("PNG")[:60], "is cut off"),
        (b"\xff\xd8" + b"\0" * 100 + b"\xff\xd9", "is a damaged JPEG"),
        (b"\xff\xd8\xff\xd9", "is a damaged JPEG"),
        (b"\x89PNG\r\n\x1a\n" + b"\0" * 60, "is a damaged PNG"),
        (wide(picture("JPEG"), start_of_frame(picture("JPEG"))), "has 20000 x 20000 pixels"),
        (wide(picture("JPEG"), start_of_frame(picture("JPEG")), b"\0\0\0\0"), "has no pixels"),
        (wide(picture("PNG"), 16, b"\0\0\x4e\x20\0\0\x4e\x20"), "has 20000 x 20000 pixels"),
        (picture("JPEG") + b"\0" * LARGEST_BYTES, "at most 4194304 are shown"),
    ],
)
def test_a_bad_picture_is_refused_in_words(encoded, reason):
    with pytest.raises(Damaged, match=reason):
        read_header(encoded)


def test_any_bytes_are_read_or_refused():
    whole = picture("JPEG")
    for at in range(2, len(whole) - 2):
        for value in (0x00, 0xFF, 0xC0):
            damaged = whole[:at] + bytes([value]) + whole[at + 1 :]
            try:
                header = read_header(damaged)
            except Damaged:
                continue
            assert 1 <= header.width <= 4096
