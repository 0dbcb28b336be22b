"""The robot in 3D, in Chromium's software renderer: pictures a second while it is turned, and a drive beside it.

`turned`: pictures a second with 20,000 points. `driving`: a person drives by a key with the 3D view open, while other
programs compute; a drive that drawing delays ends with "no command came for 0.3 s". `FLEET_BENCH_PARTS`: the parts to
run; `FLEET_BENCH_SECONDS`: of the drive.
"""

from __future__ import annotations

import asyncio
import itertools
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from playwright.async_api import Page, WebSocket

from benchmarks.harness import Figure, progress, quantile
from benchmarks.parts.chromium import signed_in
from script.stack.client import sign_in
from script.stack.stack import PRACTICE_ROBOTS, Stack, temporary_stack

ROBOT = "tiago-1"
POINTS = 20_000
LINKS = 15
MEASURED_S = 10.0
SETTLED_S = 5.0  # until the view has chosen how finely it draws
OPENED_S = 30.0
SIZES = ((1440, 900), (360, 640))
LONGEST_MS = 34.0  # two frames of a screen of 60 Hz: the view draws every second frame
PARTS = ("turned", "driving")
DRIVEN_S = 600.0
BURNERS = 2  # programs that compute all the time: with robot, console and browser, a load of about four
REPEAT_S = 0.5  # a held key repeats
WAY_S = 10.0  # in one direction, then in the other

_SCENE = "document.querySelector('[data-part=scene]').scene"
_OPEN = "() => document.querySelector('[data-view=scene]').click()"
_THERE = f"() => ({_SCENE}?.figures.links ?? 0) > {LINKS}"
_FACTS = f"() => {_SCENE}.figures"
# A key turns the view at each frame of the page. Only pictures that the view has drawn are counted.
_TURN = f"""(seconds) => new Promise((done) => {{
  const canvas = document.querySelector(".scene-canvas");
  const scene = {_SCENE};
  const began = performance.now();
  const times = [];
  let drawn = scene.figures.frames;
  const look = () => {{
    const now = performance.now();
    const {{ frames }} = scene.figures;
    if (frames !== drawn) times.push(now);
    drawn = frames;
    if (now - began > 1000 * seconds) return done(times);
    canvas.dispatchEvent(new KeyboardEvent("keydown", {{ key: "ArrowLeft" }}));
    requestAnimationFrame(look);
  }};
  requestAnimationFrame(look);
}})"""


def measure() -> list[Figure]:
    """Run one robot, and let people look at it in 3D."""
    parts = os.environ.get("FLEET_BENCH_PARTS", " ".join(PARTS)).split()
    with temporary_stack(robots=PRACTICE_ROBOTS[:1]) as stack:
        figures = asyncio.run(measure_turned(stack)) if "turned" in parts else []
        return figures + (asyncio.run(measure_driving(stack)) if "driving" in parts else [])


async def measure_turned(stack: Stack) -> list[Figure]:
    """Return the figures of pictures in windows of both sizes."""
    cookie = await asyncio.to_thread(sign_in, stack, "observer")
    figures: list[Figure] = []
    async with signed_in(stack, cookie) as page:
        for width, height in SIZES:
            figures += await turned(page, stack, width, height)
    return figures


async def turned(page: Page, stack: Stack, width: int, height: int) -> list[Figure]:
    """Return the figures of a window of this size."""
    await page.set_viewport_size({"width": width, "height": height})
    await page.goto(f"{stack.url}/robots/{ROBOT}/")
    await page.wait_for_function("() => document.querySelector('[data-cameras]')", timeout=1000 * OPENED_S)
    began = await page.evaluate("performance.now()")
    await page.evaluate(_OPEN)
    await page.wait_for_function(_THERE, timeout=1000 * OPENED_S)
    opened_ms = await page.evaluate("performance.now()") - began
    await page.evaluate(f"{_SCENE}.fill({POINTS})")
    await page.evaluate(_TURN, SETTLED_S)
    times = await page.evaluate(_TURN, MEASURED_S)
    gaps = [after - before for before, after in itertools.pairwise(times)]
    facts = await page.evaluate(_FACTS)
    progress(
        f"{width} x {height}: {facts['points']} points, {facts['triangles']} triangles, "
        f"{facts['pixels'][0]} x {facts['pixels'][1]} pixels; load {os.getloadavg()[0]:.1f}"
    )
    name = f"{width} x {height}:"
    return [
        Figure(f"{name} picture after picture p50", quantile(gaps, 0.5), "ms", LONGEST_MS),
        Figure(f"{name} p95", quantile(gaps, 0.95), "ms"),
        Figure(f"{name} pictures a second", len(gaps) / MEASURED_S, "1/s"),
        Figure(f"{name} pixels of a picture", facts["pixels"][0] * facts["pixels"][1] / 1e6, "M"),
        Figure(f"{name} opened, until the robot is there", opened_ms / 1000.0, "s"),
    ]


async def measure_driving(stack: Stack) -> list[Figure]:
    """Return how often a drive by a held key was interrupted while the page drew in 3D and others computed."""
    seconds = float(os.environ.get("FLEET_BENCH_SECONDS", DRIVEN_S))
    cookie = await asyncio.to_thread(sign_in, stack, "operator")
    async with signed_in(stack, cookie) as page:
        drive = Drive(page)
        await page.set_viewport_size({"width": SIZES[0][0], "height": SIZES[0][1]})
        await page.goto(f"{stack.url}/robots/{ROBOT}/")
        await page.locator("[data-action=take]").click()
        await page.evaluate(_OPEN)
        await page.wait_for_function(_THERE, timeout=1000 * OPENED_S)
        with burning():
            began_s, loads = time.monotonic(), []
            before = await page.evaluate(_FACTS)
            while (gone_s := time.monotonic() - began_s) < seconds:
                await drive.hold("a" if gone_s // WAY_S % 2 else "d")
                loads.append(os.getloadavg()[0])
            after = await page.evaluate(_FACTS)
        await drive.let_go()
    load = quantile(loads, 0.5)
    progress(f"{seconds:.0f} s, load {load:.1f}; held back: {drive.held_back}")
    return [
        Figure(
            "drive beside 3D: no command came for 0.3 s", drive.held_back.get("dead_man", 0), "times", 0.0
        ),
        Figure("drive beside 3D: interrupted for other reasons", drive.others, "times"),
        Figure("drive beside 3D: share of the time that it drove", drive.share, ""),
        Figure("drive beside 3D: pictures a second", (after["frames"] - before["frames"]) / seconds, "1/s"),
        Figure("drive beside 3D: load of the computer, median", load, ""),
    ]


class Drive:
    """A person who holds a key, and releases it when the stick must rest; counts why it had to."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self._key = ""
        self._needed: str | None = None
        self._moves = 0
        self._views = 0
        self.held_back: dict[str, int] = {}
        page.on("websocket", self._listen)

    @property
    def others(self) -> int:
        """How often the stick had to rest for other reasons than a silent page."""
        return sum(self.held_back.values()) - self.held_back.get("dead_man", 0)

    @property
    def share(self) -> float:
        """The share of reports in which the robot moved."""
        return self._moves / max(self._views, 1)

    async def hold(self, key: str) -> None:
        """Hold this key for the time of one repeat."""
        if self._needed or key != self._key:
            await self.let_go()
        if not self._needed:
            self._key = key
            await self._page.keyboard.down(key)
        await asyncio.sleep(REPEAT_S)

    async def let_go(self) -> None:
        """Release the key."""
        if self._key:
            await self._page.keyboard.up(self._key)
        self._key = ""

    def _listen(self, socket: WebSocket) -> None:
        socket.on("framereceived", lambda frame: self._hear(frame))

    def _hear(self, frame: str | bytes) -> None:
        message: dict[str, Any] = json.loads(frame) if isinstance(frame, str) else {}
        state = message.get("state")
        if message.get("t") != "view" or not state or not self._key:
            return
        self._views += 1
        self._moves += bool(state["odometry"] and abs(state["odometry"]["w"]) > 0.05)
        needed = state["neutral_needed"] and state["neutral_needed"]["code"]
        if needed and needed != self._needed:
            self.held_back[needed] = self.held_back.get(needed, 0) + 1
        self._needed = needed


@contextmanager
def burning() -> Iterator[None]:
    """Context: other programs compute all the time."""
    others = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(BURNERS)]
    try:
        yield
    finally:
        for other in others:
            other.kill()
            other.wait()
