"""The robot in 3D, in Chromium's software renderer: pictures a second while it is turned, and a drive beside it.

`turned`: pictures a second with 20,000 points. `driving`: a person drives by a key beside the 3D view and, by turns,
beside the plan, while other programs compute; a drive that drawing delays ends with "no command came for 0.3 s".
`FLEET_BENCH_PARTS`: the parts to run; `FLEET_BENCH_SECONDS`: of the drive beside each view.
"""

from __future__ import annotations

import asyncio
import itertools
import json
import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
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
SLOT_S = 30.0  # beside one view, then beside the other
DRIVEN_BESIDE = ("scene", "plan")  # 3D, and a view that draws little

_SCENE = "document.querySelector('[data-part=scene]').scene"
_OPEN = "(view) => document.querySelector(`button[data-view=${view}]`).click()"
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
    await page.evaluate(_OPEN, "scene")
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
    """Return how often a drive by a held key was interrupted beside each view, while others computed."""
    seconds = float(os.environ.get("FLEET_BENCH_SECONDS", DRIVEN_S))
    cookie = await asyncio.to_thread(sign_in, stack, "operator")
    met = {view: Met() for view in DRIVEN_BESIDE}
    async with signed_in(stack, cookie) as page:
        drive = Drive(page)
        await page.set_viewport_size({"width": SIZES[0][0], "height": SIZES[0][1]})
        await page.goto(f"{stack.url}/robots/{ROBOT}/")
        await page.locator("[data-action=take]").click()
        with burning():
            while any(one.seconds < seconds for one in met.values()):
                for view, one in met.items():
                    await page.evaluate(_OPEN, view)
                    await page.wait_for_function(_THERE, timeout=1000 * OPENED_S)
                    await drive.beside(one, min(SLOT_S, seconds - one.seconds))
    return [
        *met["scene"].figures("drive beside 3D", 0.0),
        *met["plan"].figures("drive beside the plan", None),
    ]


@dataclass
class Met:
    """The interruptions of a drive beside one view of the page."""

    seconds: float = 0.0
    held_back: Counter[str] = field(default_factory=Counter)  # why the stick had to rest, by code
    gaps_ms: list[float] = field(default_factory=list)  # between two commands to move, by the page's clock
    loads: list[float] = field(default_factory=list)
    reports: int = 0  # of the robot
    moved: int = 0  # of these, while it moved
    pictures: int = 0

    def figures(self, name: str, limit: float | None) -> list[Figure]:
        """Return the figures of this view."""
        progress(f"{name}: {self.seconds:.0f} s; held back: {dict(self.held_back)}")
        silent = self.held_back["dead_man"]
        return [
            Figure(f"{name}: no command came for 0.3 s", silent, "times", limit),
            Figure(f"{name}: interrupted for other reasons", self.held_back.total() - silent, "times"),
            Figure(f"{name}: command after command, p99", quantile(self.gaps_ms, 0.99), "ms"),
            Figure(f"{name}: command after command, longest", max(self.gaps_ms, default=float("nan")), "ms"),
            Figure(f"{name}: share of the time that it drove", self.moved / max(self.reports, 1), ""),
            Figure(f"{name}: 3D pictures a second", self.pictures / max(self.seconds, 1.0), "1/s"),
            Figure(f"{name}: load of the computer, median", quantile(self.loads, 0.5), ""),
        ]


class Drive:
    """A person who holds a key, and releases it when the stick must rest; counts why it had to."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self._key = ""
        self._needed: str | None = "not known yet"
        self._sent_ms: float | None = None  # of the last command, if it was one to move
        self._met = Met()
        page.on("websocket", self._listen)

    async def beside(self, met: Met, seconds: float) -> None:
        """Drive to and fro for this time."""
        self._met = met
        began_s, before = time.monotonic(), await self._page.evaluate(_FACTS)
        while (gone_s := time.monotonic() - began_s) < seconds:
            await self._hold("a" if gone_s // WAY_S % 2 else "d")
            met.loads.append(os.getloadavg()[0])
        met.seconds += gone_s
        met.pictures += (await self._page.evaluate(_FACTS))["frames"] - before["frames"]
        await self._let_go()

    async def _hold(self, key: str) -> None:
        """Hold this key for the time of one repeat."""
        if self._needed or key != self._key:
            await self._let_go()
        if not self._needed:
            self._key = key
            await self._page.keyboard.down(key)
        await asyncio.sleep(REPEAT_S)

    async def _let_go(self) -> None:
        if self._key:
            await self._page.keyboard.up(self._key)
        self._key = ""

    def _listen(self, socket: WebSocket) -> None:
        socket.on("framesent", lambda frame: self._say(frame))
        socket.on("framereceived", lambda frame: self._hear(frame))

    def _say(self, frame: str | bytes) -> None:
        message: dict[str, Any] = json.loads(frame) if isinstance(frame, str) else {}
        if message.get("t") != "drive":
            return
        moves, before_ms = bool(message["x"] or message["w"]), self._sent_ms
        self._sent_ms = message["sent_ms"] if moves else None
        if moves and before_ms is not None:
            self._met.gaps_ms.append(message["sent_ms"] - before_ms)

    def _hear(self, frame: str | bytes) -> None:
        message: dict[str, Any] = json.loads(frame) if isinstance(frame, str) else {}
        state = message.get("state")
        if message.get("t") != "view" or not state:
            return
        needed = state["neutral_needed"] and state["neutral_needed"]["code"]
        if self._key:
            self._met.reports += 1
            self._met.moved += bool(state["odometry"] and abs(state["odometry"]["w"]) > 0.05)
            if needed and needed != self._needed:
                self._met.held_back[needed] += 1
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
