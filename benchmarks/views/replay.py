"""A recording of 1 GB on its page, at eight moments: from the directory, and through the shelf.

Seconds from the navigation until plan and picture of the moment are shown. The file is as the recorder writes 20 MB/s
of pictures, scans and what pages show. It is not in memory at first.
"""

from __future__ import annotations

import asyncio
import io
import os
import struct
import time
from contextlib import closing
from pathlib import Path
from uuid import uuid4

import numpy as np
import PIL.Image
from msgspec import structs

from benchmarks.harness import Figure, progress, quantile
from benchmarks.parts.chromium import signed_in
from robots.bridge.recorder.files.mcap_file import McapFile
from robots.shared import wire
from script.stack.client import Driver, sign_in
from script.stack.processes import ReservedPort
from script.stack.stack import PRACTICE_ROBOTS, Stack, temporary_stack

ROBOT = PRACTICE_ROBOTS[0].slug
HOST = "127.0.0.2"
BYTES = int(os.environ.get("FLEET_BENCH_BYTES", 1_000_000_000))
MOMENTS = 8
OPEN_S = 1.0
LONGEST_S = 60.0
PICTURE_HZ, VIEW_HZ, SCAN_HZ = 30, 20, 50
PICTURES = 8  # different ones
SCAN_BYTES = 2700
ROWS = """
from datetime import UTC, datetime
from robots.recordings.models import Recording
from robots.registry.models import Robot
from robots.registry.services import robot_save
robot = Robot.objects.get(slug={slug!r})
robot.bridge_address = {address!r}
robot_save(robot=robot, actor=None)
begins, ends = (datetime.fromtimestamp(at, UTC) for at in ({begins}, {ends}))
for pk, directory in {directories!r}.items():
    Recording.objects.create(
        pk=pk, robot=robot, kind="by_hand", begins_at=begins, ends_at=ends, bytes={size}, directory=directory,
        file=f"20261130T000000Z-by_hand-{{pk}}.mcap",
    )
"""
SHOWN = """
(() => {
  const look = () => {
    const picture = document.querySelector("[data-part=camera]");
    const says = document.querySelector("[data-part=says]")?.textContent;
    if (says && picture?.naturalWidth && !picture.hidden) console.info(`shown ${performance.now()}`);
    else requestAnimationFrame(look);
  };
  look();
})()
"""


def measure() -> list[Figure]:
    """Start a console with one robot, and open a recording of it."""
    settings = {"FLEET_RECORDINGS": "", "FLEET_BRIDGE_HOST": HOST, "FLEET_LINK_SECRET": "s" * 40}
    with temporary_stack(PRACTICE_ROBOTS[:1], settings=settings) as stack:
        return asyncio.run(_measure_on(stack))


async def _measure_on(stack: Stack) -> list[Figure]:
    staff = await asyncio.to_thread(sign_in, stack, "staff")
    async with Driver(stack, ROBOT, staff) as driver:
        await driver.until(lambda: driver.view and driver.view.scan)
        view = _standing(driver.view)
    folder = stack.directory / "recordings"
    folder.mkdir(exist_ok=True)
    places = {"from the directory": str(folder), "through the shelf": "/nowhere"}
    rows = {place: str(uuid4()) for place in places}
    paths = [folder / f"20261130T000000Z-by_hand-{row}.mcap" for row in rows.values()]
    progress(f"{BYTES / 1e6:.0f} MB are written ...")
    begins = time.time() - 3600.0
    lasts_s = _write(paths[0], view, begins)
    os.link(*paths)
    with closing(ReservedPort(HOST)) as port:
        script = ROWS.format(
            slug=ROBOT,
            address=f"wss://{HOST}:{port.number}",
            begins=begins,
            ends=begins + lasts_s,
            size=paths[0].stat().st_size,
            directories={rows[place]: directory for place, directory in places.items()},
        )
        command = stack.manage("rows", "shell", "-c", script)
        if not await asyncio.to_thread(command.wait, LONGEST_S) or command.process.returncode:
            raise RuntimeError("the rows were not made")
        stack.release(command)
        await asyncio.to_thread(stack.wait_online, ROBOT, time.monotonic() + LONGEST_S)
        figures = []
        for place, row in rows.items():
            moments = [round(lasts_s * (number + 0.5) / MOMENTS, 1) for number in range(MOMENTS)]
            took = [await _opened(stack, staff, f"{row}/?t={moment}", paths[0]) for moment in moments]
            progress(f"{place}: {', '.join(f'{seconds:.2f}' for seconds in took)} s")
            figures += [
                Figure(f"opened {place}, p50", quantile(took, 0.5), "s", OPEN_S),
                Figure(f"opened {place}, worst of {MOMENTS}", max(took), "s"),
            ]
    return figures


def _standing(view: wire.View | None) -> bytes:
    """Return a view with a text, which the page says when it has the view."""
    if view is None:
        raise RuntimeError("there is no view")
    return wire.encode(structs.replace(view, state=structs.replace(view.state, text="It stands.")))


async def _opened(stack: Stack, cookie: str, address: str, path: Path) -> float:
    """Return the seconds until plan and picture are shown, in a new browser."""
    with path.open("rb") as file:  # forget what is in memory
        os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
    async with signed_in(stack, cookie) as page:
        await page.goto(f"{stack.url}/healthz")  # the browser's own start does not count
        await page.add_init_script(SHOWN)
        shown = page.expect_console_message(
            lambda line: line.text.startswith("shown"), timeout=LONGEST_S * 1000.0
        )
        async with shown as line:
            await page.goto(f"{stack.url}/recordings/{address}", wait_until="commit")
        return float((await line.value).text.split()[1]) / 1000.0


def _write(path: Path, view: bytes, begins: float) -> float:
    """Write the file; return how many seconds it lasts."""
    with path.open("xb", buffering=0) as stream:
        file = McapFile(stream, "ros1")
        kinds = {
            "/fleet/view": ("json", file.schema("fleet/View", "jsonschema", b"{}")),
            "/scan": ("ros1", file.schema("sensor_msgs/LaserScan", "ros1msg", b"float32[] ranges")),
            "/camera": (
                "ros1",
                file.schema("sensor_msgs/CompressedImage", "ros1msg", b"string format\nuint8[] data"),
            ),
        }
        channels = {topic: file.channel(topic, *kind, {}) for topic, kind in kinds.items()}
        pictures = [_picture(number) for number in range(PICTURES)]
        for second in range(10_000):
            for at_s, topic, number in _second():
                at_ns = round((begins + second + at_s) * 1e9)
                match topic:
                    case "/fleet/view":
                        data = view
                    case "/scan":
                        data = struct.pack("<I", SCAN_BYTES // 4) + os.urandom(SCAN_BYTES)
                    case _:
                        data = pictures[number % PICTURES]
                file.add(channels[topic], number, at_ns, data)
            file.flush()
            if file.at > BYTES:
                break
        file.finish()
        os.fsync(stream)
    return second + 1.0


def _second() -> list[tuple[float, str, int]]:
    """Return what comes in a second, in order."""
    rates = {"/camera": PICTURE_HZ, "/fleet/view": VIEW_HZ, "/scan": SCAN_HZ}
    return sorted(
        (number / rate_hz, topic, number) for topic, rate_hz in rates.items() for number in range(rate_hz)
    )


def _picture(number: int) -> bytes:
    """Return a message with a picture of noise, of 0.65 MB."""
    noise = np.random.default_rng(number).integers(0, 255, (600, 800, 3), np.uint8)
    packed = io.BytesIO()
    PIL.Image.fromarray(noise).save(packed, "JPEG", quality=85)
    data = packed.getvalue()
    return struct.pack("<I", 4) + b"jpeg" + struct.pack("<I", len(data)) + data
