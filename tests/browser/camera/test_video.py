"""H.264 from the camera process in a real browser: a damaged stream goes on at its next key picture."""

from __future__ import annotations

import base64
import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import numpy as np
import PIL.Image
import pytest
from playwright.sync_api import Browser, Page

from robots.bridge.camera.pictures.h264 import H264Encoder
from tests.processes import REPOSITORY

WIDTH, HEIGHT = 320, 240
KEYS = (0, 6)  # numbers of the key pictures: the decoder can begin with these
PICTURES = 9
DAMAGED = 3

# Gives the pictures to the page's decoder, one after the other, and returns the result of each.
_PLAY = """
async (pictures) => {
  const { CameraPicture } = await import("/js/camera/camera_picture.js");
  const { decodesVideo } = await import("/js/camera/video.js");
  if (!(await decodesVideo())) return null;
  const canvas = document.createElement("canvas");
  const shown = new CameraPicture(canvas);
  const done = [];
  let tell = () => {};
  shown.addEventListener("done", ({ detail }) => {
    const { header, damaged } = detail;
    done.push([header.number, damaged]);
    tell();
  });
  for (const { number, key, encoded } of pictures) {
    const bytes = Uint8Array.from(atob(encoded), (letter) => letter.charCodeAt(0));
    const header = { camera: "head", number, format: "h264", key, width: 320, height: 240 };
    const over = new Promise((resolve) => (tell = resolve));
    shown.take({ header, bytes, takenMs: 0 });
    await over;
  }
  const [red, green, blue] = canvas.getContext("2d").getImageData(160, 120, 1, 1).data;
  return { done, size: [canvas.width, canvas.height], colour: [red, green, blue] };
}
"""


class Quiet(SimpleHTTPRequestHandler):
    """Serves files and writes no log."""

    def log_message(self, format: str, *args: object) -> None:
        """Write no log."""


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """An empty page of a server with the console's scripts."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(REPOSITORY / "static")))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    context = browser.new_context()
    opened = context.new_page()
    opened.goto(f"http://127.0.0.1:{server.server_port}/js/")
    yield opened
    context.close()
    server.shutdown()
    server.server_close()


def pictures() -> list[dict[str, Any]]:
    """Return pictures of a square that moves over blue, encoded as by the camera process."""
    video, made = H264Encoder(), []
    for number in range(PICTURES):
        pixels = np.full((HEIGHT, WIDTH, 3), (20, 40, 200), np.uint8)
        pixels[20:60, 20 * number : 20 * number + 40] = (220, 200, 30)
        if number in KEYS:
            video.require_key()
        unit, is_key = video.encode(PIL.Image.fromarray(pixels))
        assert is_key == (number in KEYS)
        made.append({"number": number, "key": is_key, "unit": unit})
    return made


def play(page: Page, made: list[dict[str, Any]]) -> dict[str, Any]:
    encoded = [{**one, "encoded": base64.b64encode(one.pop("unit")).decode()} for one in made]
    result: dict[str, Any] | None = page.evaluate(_PLAY, encoded)
    assert result is not None, "this browser decodes H.264"
    return result


def cut_short(unit: bytes) -> bytes:
    return unit[:8]


def overwritten(unit: bytes) -> bytes:
    return unit[:5] + bytes((0xFF, 0x00) * 20) + unit[45:]


def emptied(unit: bytes) -> bytes:
    return b""


def test_a_sound_stream_is_painted(page: Page) -> None:
    shown = play(page, pictures())
    assert shown["done"] == [[number, False] for number in range(PICTURES)]
    is_painted(shown)


def is_painted(shown: dict[str, Any]) -> None:
    """Check that the last picture is on the canvas."""
    assert shown["size"] == [WIDTH, HEIGHT]
    assert all(abs(is_ - was) < 30 for is_, was in zip(shown["colour"], (20, 40, 200), strict=True))


@pytest.mark.parametrize("damage", [cut_short, overwritten, emptied])
def test_a_damaged_stream_goes_on_at_its_next_key_picture(page: Page, damage: Any) -> None:
    made = pictures()
    made[DAMAGED]["unit"] = damage(made[DAMAGED]["unit"])
    shown = play(page, made)
    is_painted(shown)
    done = dict(shown["done"])
    assert len(done) == PICTURES, "each picture is acknowledged"
    assert [done[number] for number in range(DAMAGED)] == [False] * DAMAGED
    assert [done[number] for number in range(KEYS[1], PICTURES)] == [False] * (PICTURES - KEYS[1])
