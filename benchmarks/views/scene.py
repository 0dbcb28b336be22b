"""The robot in 3D: pictures a second in Chromium's software renderer, with 20,000 points, while it is turned."""

from __future__ import annotations

import asyncio
import itertools
import os

from playwright.async_api import Page

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
    """Run one robot, and let an observer look at it in 3D."""
    with temporary_stack(robots=PRACTICE_ROBOTS[:1]) as stack:
        return asyncio.run(measure_on(stack))


async def measure_on(stack: Stack) -> list[Figure]:
    """Return all figures."""
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
