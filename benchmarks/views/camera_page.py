"""Read the clock code of camera pictures from a canvas in a real browser: the age of each shown picture."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import NamedTuple

from playwright.async_api import Page

from benchmarks.harness import quantile
from benchmarks.parts.chromium import clock_offset_s, signed_in
from robots.simulator.cameras.clock_code import BLOCKS, TICKS_PER_S
from robots.simulator.sensors.depth import WIDTH
from script.stack.stack import Stack

CANVAS = "canvas.camera-picture"  # of a robot's page
FIRST_PICTURE_S = 30.0

# At each frame of the page: [time in the picture in 0.1 ms, performance.now()] of each new picture. The code is
# described in robots/simulator/cameras/clock_code.py.
_WATCH = """
([selector, blocks]) => {
  const canvas = document.querySelector(selector);
  const pen = canvas.getContext("2d");
  const seen = (window.benchSeen = []);
  const bits = (ones, begin, end) => ones.slice(begin, end).reduce((number, one) => number * 2 + one, 0);
  const read = () => {
    const side = canvas.width / blocks;
    if (side < 4) return null;
    const row = pen.getImageData(0, Math.floor(side / 2), canvas.width, 1).data;
    const ones = Array.from({ length: blocks }, (_, block) => {
      const at = 4 * Math.floor((block + 0.5) * side);
      return row[at] + row[at + 1] + row[at + 2] > 381 ? 1 : 0;
    });
    let parity = 10;
    for (let group = 2; group < 34; group += 4) parity ^= bits(ones, group, group + 4);
    const framed = ones[0] && !ones[1] && !ones[38] && ones[39];
    return framed && parity === bits(ones, 34, 38) ? bits(ones, 2, 34) : null;
  };
  let last = null;
  const look = () => {
    const ticks = read();
    if (ticks !== null && ticks !== last) seen.push([ticks, performance.now()]);
    last = ticks ?? last;
    requestAnimationFrame(look);
  };
  requestAnimationFrame(look);
}
"""

# The page sets its canvas to the picture's size when it paints the first picture.
_PAINTED = """
([selector, width]) => {
  return document.querySelector(selector)?.width === width ? performance.now() : null;
}
"""


class Shown(NamedTuple):
    """A picture: its age in seconds when the page first showed it, and the time of this (CLOCK_MONOTONIC)."""

    age_s: float
    at_s: float


@dataclass(frozen=True)
class Measured:
    """All pictures that were shown during a measurement."""

    pictures: list[Shown]
    seconds: float
    video_share: float  # share of the received pictures that are H.264

    def age_ms(self, share: float) -> float:
        """Return a quantile of the ages, in milliseconds."""
        return 1000.0 * quantile([picture.age_s for picture in self.pictures], share)

    @property
    def rate_hz(self) -> float:
        """Return the pictures shown in a second."""
        return len(self.pictures) / self.seconds


class CameraPage:
    """A page whose canvas shows pictures with a clock code."""

    def __init__(self, page: Page, offset_s: float, formats: list[str]) -> None:
        self._page = page
        self._offset_s = offset_s
        self._formats = formats  # of the pictures received over the page's WebSocket; the list grows

    async def measure(self, seconds: float) -> Measured:
        """Measure the pictures shown in this time."""
        await self._page.evaluate("window.benchSeen.length = 0")
        self._formats.clear()
        await asyncio.sleep(seconds)
        seen: list[list[float]] = await self._page.evaluate("window.benchSeen")
        shown = []
        for ticks, at_ms in seen:
            at_s = self._offset_s + at_ms / 1000.0
            shown.append(Shown((at_s - ticks / TICKS_PER_S) % (2**32 / TICKS_PER_S), at_s))
        return Measured(shown, seconds, self._formats.count("h264") / max(len(self._formats), 1))


async def _watching(page: Page, formats: list[str]) -> CameraPage:
    await page.wait_for_selector(CANVAS)
    await page.evaluate(_WATCH, [CANVAS, BLOCKS])
    end_s = time.monotonic() + FIRST_PICTURE_S
    while not await page.evaluate("window.benchSeen.length"):
        if time.monotonic() > end_s:
            raise TimeoutError(f"{page.url} shows no picture with a clock code.")
        await asyncio.sleep(0.1)
    return CameraPage(page, await clock_offset_s(page), formats)


def _formats_of(page: Page) -> list[str]:
    """Return a list to which the format of each picture is added that comes over the page's WebSockets."""
    formats: list[str] = []

    def received(frame: str | bytes) -> None:
        if isinstance(frame, bytes):  # the header's length, the header, the picture
            formats.append(json.loads(frame[4 : 4 + int.from_bytes(frame[:4], "big")])["format"])

    page.on("websocket", lambda socket: socket.on("framereceived", received))
    return formats


@asynccontextmanager
async def console_page(
    stack: Stack, slug: str, cookie: str, port: int | None = None, *, decodes_video: bool = True
) -> AsyncIterator[CameraPage]:
    """Context: the robot's page, which shows its camera. `port`: the port of a cable to the console.

    Without `decodes_video` the browser cannot decode H.264.
    """
    rules = (f"MAP {stack.hosts[0]}:{stack.port} {stack.hosts[0]}:{port}",) if port else ()
    async with signed_in(stack, cookie, rules) as page:
        if not decodes_video:
            await page.add_init_script("delete window.VideoDecoder")
        formats = _formats_of(page)
        await page.goto(f"{stack.url}/robots/{slug}/")
        yield await _watching(page, formats)


async def first_picture_s(stack: Stack, slug: str, cookie: str) -> float:
    """Return the seconds from the navigation to the robot's page until its canvas shows a camera picture.

    The browser is new: its cache is empty.
    """
    async with signed_in(stack, cookie) as page:
        await page.goto(f"{stack.url}/healthz")  # the browser's own start does not count
        await page.goto(f"{stack.url}/robots/{slug}/", wait_until="commit")
        painted = await page.wait_for_function(
            _PAINTED, arg=[CANVAS, WIDTH], polling="raf", timeout=1000.0 * FIRST_PICTURE_S
        )
        return float(await painted.json_value()) / 1000.0
