"""Live camera: first picture, age on the page, cost, slow network, stalled viewer, lost right, commands.

The simulated head camera draws the time into its pictures. Chromium's page reads this time from its canvas. A
picture's age counts from the robot's stamp, so drawing and encoding in the simulator are part of the age.
A robot with ROS 2 is compared with one with ROS 1 on the same console.
`FLEET_BENCH_PARTS`, `FLEET_BENCH_SECONDS`, `FLEET_BENCH_SLOTS`: fewer parts, shorter parts.
"""

from __future__ import annotations

import asyncio
import math
import os
import signal
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from benchmarks.driving.drive import BARE_STICKS, SLOT, delays, drive
from benchmarks.driving.drive import BOTH as BOTH_ROS
from benchmarks.harness import Figure, progress, quantile
from benchmarks.parts import process_stats
from benchmarks.parts.cable import Cable, Profile
from benchmarks.parts.observer import Observer, start_ros_side
from benchmarks.parts.priority import prefer_loops_or_say
from benchmarks.parts.role_switch import role_switch
from benchmarks.parts.viewer_crowd import Crowd
from benchmarks.parts.with_ros2 import with_ros2
from benchmarks.views.camera_page import (
    Measured,
    console_page,
    first_picture_s,
)
from robots.bridge.served.client import LINGER_S
from script.stack.client import Driver, sign_in
from script.stack.stack import Stack, temporary_stack

ROBOT, CAMERA = "tiago-1", "head"
ROLES = ("observer", "operator", "supervisor", "staff")
PLAN, *BOTH = (replace(plan, options=("--camera-clock",)) for plan in (BARE_STICKS[0], *BOTH_ROS))
PARTS = ("first", "glass", "slow", "stall", "rights", "cost", "commands", "ros2")
MEASURED_S = 20.0
SETTLED_S = 3.0
VIEWERS = 10
SLOTS = 10  # each with viewers and without, in turn
SLOW = Profile("500 kbit/s, 100 ms", 500, 100)
ADAPTED_S = 12.0  # until the quality fits a slow network
OPENINGS = 3  # of the page without a camera process; the page is opened again at once, with a camera process
FIRST_S = 2.0
AGE_P50_MS, AGE_P95_MS = 60.0, 120.0
SLOW_HZ, SLOW_P95_MS = 8.0, 400.0
LOST_PERCENT = 1.0
RIGHTS_LOST = 10  # times
ENDS_S = 1.0
CORE_PERCENT = 5.0
COMMAND_TIMES = 1.2
ROUNDS, ROS2_TIMES = 2, 1.3
BAD_PICTURES = "camera_bomb"


def measure() -> list[Figure]:
    """Run one robot; watch its camera. Then run a robot of each ROS."""
    parts = os.environ.get("FLEET_BENCH_PARTS", " ".join(PARTS)).split()
    figures: list[Figure] = []
    if parts != ["ros2"]:
        with temporary_stack((PLAN,)) as stack:
            figures += asyncio.run(measure_on(stack, parts))
    if "ros2" in parts:
        figures += with_ros2(BOTH, compare_both)
    return figures


async def measure_on(stack: Stack, parts: Sequence[str]) -> list[Figure]:
    """Return the figures of these parts, one after the other."""
    prefer_loops_or_say(stack)
    # Several people, because one person may not begin so many viewings in a few minutes: each is a record.
    cookies = [await asyncio.to_thread(sign_in, stack, role) for role in ROLES]
    bench = Bench(stack, cookies)
    figures: list[Figure] = []
    for part, measured in (
        ("first", bench.first_picture),
        ("glass", bench.glass_to_glass),
        ("slow", bench.slow_network),
        ("stall", bench.one_stalls),
        ("rights", bench.rights_lost),
        ("cost", bench.cost),
        ("commands", bench.commands),
    ):
        if part in parts:
            figures += await measured()
    return figures


async def compare_both(stack: Stack) -> list[Figure]:
    """Watch the camera of a robot of each ROS in turn."""
    prefer_loops_or_say(stack)
    cookie = await asyncio.to_thread(sign_in, stack, "operator")
    seconds = float(os.environ.get("FLEET_BENCH_SECONDS", MEASURED_S))
    shown: dict[int, list[float]] = {}
    for _ in range(ROUNDS):
        for plan in BOTH:
            progress(f"1 viewer, ROS {plan.ros} ...")
            async with console_page(stack, plan.slug, cookie) as page:
                await asyncio.sleep(SETTLED_S)
                measured = await page.measure(seconds)
            shown.setdefault(plan.ros, []).extend(picture.age_s for picture in measured.pictures)
    figures = [
        figure
        for ros, ages_s in shown.items()
        for figure in (
            *delays(f"ROS {ros}, 1 viewer: age", ages_s),
            Figure(f"ROS {ros}, 1 viewer: pictures", len(ages_s) / ROUNDS / seconds, "/s"),
        )
    ]
    times = {
        "age p50": quantile(shown[2], 0.50) / quantile(shown[1], 0.50),
        "age p95": quantile(shown[2], 0.95) / quantile(shown[1], 0.95),
        "time between pictures": len(shown[1]) / max(len(shown[2]), 1),
    }
    return figures + [
        Figure(f"camera, {what}: ROS 2 / ROS 1", value, "times", ROS2_TIMES) for what, value in times.items()
    ]


class Bench:
    """One robot and its viewers."""

    def __init__(self, stack: Stack, cookies: Sequence[str]) -> None:
        self._stack = stack
        self._cookies = cookies
        self._cookie = cookies[0]
        self._seconds = float(os.environ.get("FLEET_BENCH_SECONDS", MEASURED_S))

    # --- first picture -----------------------------------------------------------------------------

    async def first_picture(self) -> list[Figure]:
        """Open the robot's page and wait for its first painted picture: without a camera process, then with one."""
        cold_s: list[float] = []
        warm_s: list[float] = []
        for number in range(OPENINGS):
            progress(f"page opened without a camera process, {number + 1} of {OPENINGS} ...")
            await self._camera_process_ends()
            for times_s in (cold_s, warm_s):
                times_s.append(await first_picture_s(self._stack, ROBOT, self._cookie))
        return [
            Figure("page opened, no camera process: first picture, worst", max(cold_s), "s", FIRST_S),
            Figure("page opened again: first picture, worst", max(warm_s), "s", FIRST_S),
        ]

    async def _camera_process_ends(self) -> None:
        end_s = time.monotonic() + LINGER_S + 10.0
        while self._camera_processes():
            if time.monotonic() > end_s:
                raise TimeoutError("The camera process does not end.")
            await asyncio.sleep(0.2)

    # --- glass to glass ----------------------------------------------------------------------------

    async def glass_to_glass(self) -> list[Figure]:
        """Measure the age of pictures on a page, with one and with ten viewers."""
        figures = ages("1 viewer", await self._watched("1 viewer"), AGE_P50_MS, AGE_P95_MS)
        name = f"{VIEWERS} viewers"
        async with self._crowd(VIEWERS - 1):
            figures += ages(name, await self._watched(name), AGE_P50_MS, AGE_P95_MS)
        return figures

    async def _watched(self, name: str) -> Measured:
        progress(f"{name} ...")
        async with console_page(self._stack, ROBOT, self._cookie) as page:
            await asyncio.sleep(SETTLED_S)
            return await page.measure(self._seconds)

    def _crowd(self, count: int, *, one_stalls: bool = False) -> Crowd:
        return Crowd(self._stack, ROBOT, self._cookies, count, camera=CAMERA, one_stalls=one_stalls)

    # --- a slow network ----------------------------------------------------------------------------

    async def slow_network(self) -> list[Figure]:
        """Measure age and rate over a slow network.

        The network is fast while the page loads, then becomes slow.
        """
        figures: list[Figure] = []
        for decodes_video in (True, False):
            title = f"{SLOW.name}, browser {'with' if decodes_video else 'without'} video"
            measured = await self._slowly(title, decodes_video=decodes_video)
            figures += ages(title, measured, None, SLOW_P95_MS)
            period_ms = 1000.0 / measured.rate_hz if measured.rate_hz else math.nan
            figures.append(Figure(f"{title}: between pictures", period_ms, "ms", 1000.0 / SLOW_HZ))
            figures.append(Figure(f"{title}: share of H.264", measured.video_share, ""))
        return figures

    async def _slowly(self, name: str, *, decodes_video: bool) -> Measured:
        progress(f"{name} ...")
        async with (
            Cable(("127.0.0.1", 0), ("127.0.0.1", self._stack.port)) as cable,
            console_page(self._stack, ROBOT, self._cookie, cable.port, decodes_video=decodes_video) as page,
        ):
            cable.profile = SLOW
            await asyncio.sleep(ADAPTED_S)
            return await page.measure(self._seconds)

    # --- one viewer stalls -------------------------------------------------------------------------

    async def one_stalls(self) -> list[Figure]:
        """Let one of ten viewers read nothing, and compare the others' pictures with nine viewers alone.

        Pictures are counted for each viewer, because their numbers also count the smaller pictures that the
        console makes for the stalled viewer.
        """
        progress("one viewer stalls ...")
        rates_hz = []
        for one_stalls in (False, True):
            async with self._crowd(VIEWERS if one_stalls else VIEWERS - 1, one_stalls=one_stalls) as crowd:
                await crowd.until_all_see()
                await asyncio.sleep(SETTLED_S)
                rates_hz.append(await self._slowest_hz(crowd))
        alone_hz, beside_hz = rates_hz
        lost = 100.0 * (1.0 - beside_hz / alone_hz) if alone_hz else math.nan
        return [
            Figure("none stalls: pictures of the slowest viewer", alone_hz, "/s"),
            Figure("one stalls: pictures of the slowest other", beside_hz, "/s"),
            Figure("one stalls: the slowest other loses", lost, "%", LOST_PERCENT),
        ]

    async def _slowest_hz(self, crowd: Crowd) -> float:
        """Return the lowest number of pictures per second among the viewers that read."""
        crowd.seen.clear()
        began_s = time.monotonic()
        await asyncio.sleep(self._seconds)
        spent_s = time.monotonic() - began_s
        counts = Counter(viewer for arrivals in crowd.seen.values() for viewer in arrivals)
        return min((counts[viewer] for viewer in range(VIEWERS - 1)), default=0) / spent_s

    # --- rights ------------------------------------------------------------------------------------

    async def rights_lost(self) -> list[Figure]:
        """Take the viewer's role away during viewing.

        Measure the seconds from the commit to the last picture.
        """
        progress("rights lost ...")
        lasted_s = []
        async with role_switch(self._stack, ROBOT) as switch:
            for number in range(RIGHTS_LOST):
                async with Crowd(self._stack, ROBOT, self._cookie, 1, camera=CAMERA) as crowd:
                    await crowd.until_all_see()
                    # So the role ends at different times between two checks of rights
                    await asyncio.sleep(0.1 * number)
                    taken_s = await switch("")
                    await asyncio.sleep(2.0 * ENDS_S)
                    last_s = max(at_s for arrivals in crowd.seen.values() for at_s in arrivals.values())
                lasted_s.append(last_s - taken_s)
                await switch("observer")
        return [Figure("right lost: last picture after, worst of ten", max(lasted_s), "s", ENDS_S)]

    # --- cost --------------------------------------------------------------------------------------

    async def cost(self) -> list[Figure]:
        """Measure the processor time that ten viewers add when JPEG is passed through."""
        progress("cost ...")
        await asyncio.sleep(SETTLED_S)
        idle, _ = await self._used(0)
        async with self._crowd(VIEWERS) as crowd:
            await crowd.until_all_see()
            await asyncio.sleep(SETTLED_S)
            [camera] = self._camera_processes()
            crowd.seen.clear()
            web, process = await self._used(camera)
            shown_hz = sum(len(arrivals) for arrivals in crowd.seen.values()) / VIEWERS / self._seconds
            memory = process_stats.resident_mb(camera)
        name = f"{VIEWERS} viewers"
        return [
            Figure(f"{name}: web process adds", web - idle, "%"),
            Figure(f"{name}: camera process", process, "%"),
            Figure(f"{name}: both", web - idle + process, "%", CORE_PERCENT),
            Figure(f"{name}: pictures each", shown_hz, "/s"),
            Figure("camera process: memory", memory, "MB"),
        ]

    async def _used(self, camera: int) -> tuple[float, float]:
        """Return the percent of a core that web process and camera process (its id, 0: none) use."""
        pids = [self._stack.web.pid, *([camera] if camera else [])]
        began_s, before_s = time.monotonic(), [process_stats.cpu_s(pid) for pid in pids]
        await asyncio.sleep(self._seconds)
        spent_s = time.monotonic() - began_s
        used = [
            100.0 * (process_stats.cpu_s(pid) - before) / spent_s
            for pid, before in zip(pids, before_s, strict=True)
        ]
        return used[0], sum(used[1:])

    # --- commands ----------------------------------------------------------------------------------

    async def commands(self) -> list[Figure]:
        """Compare delays of commands without viewers, with ten, and with ten while the camera fails.

        A node of the robot subscribes to the camera all the time, so that the simulator always draws: only the work
        for viewers differs.
        """
        progress(f"commands, with {VIEWERS} camera viewers and without, in turn ...")
        robot = self._stack.robots[ROBOT]
        watcher = start_ros_side(self._stack, robot, "watch_camera")
        operator = await asyncio.to_thread(sign_in, self._stack, "operator")
        alone_s: list[float] = []
        watched_s: list[float] = []
        bad_s: list[float] = []
        killed_s: list[float] = []
        async with (
            Observer(robot) as observer,
            Driver(self._stack, ROBOT, operator) as driver,
            self._crowd(VIEWERS) as crowd,
        ):
            await driver.take()
            await driver.until(lambda: driver.state and all(sensor.ok for sensor in driver.state.sensors))
            for _ in range(int(os.environ.get("FLEET_BENCH_SLOTS", SLOTS))):
                await crowd.watch(on=False)
                alone_s += await drive(driver, observer, SLOT)
                crowd.seen.clear()
                await crowd.watch(on=True)
                await crowd.until_all_see()
                watched_s += await drive(driver, observer, SLOT)
                await observer.cause(BAD_PICTURES)
                bad_s += await drive(driver, observer, SLOT)
                await observer.cause("none")
                [camera] = self._camera_processes()
                os.kill(camera, signal.SIGKILL)  # another one starts during the drive
                killed_s += await drive(driver, observer, SLOT)
                await crowd.watch(on=False)
        self._stack.release(watcher)
        alone_p99_s = quantile(alone_s, 0.99)
        return [
            *delays("commands without viewers", alone_s),
            *delays(f"commands with {VIEWERS} viewers", watched_s),
            *(
                Figure(
                    f"commands with {what} p99 / without",
                    quantile(taken_s, 0.99) / alone_p99_s,
                    "times",
                    limit,
                )
                for what, taken_s, limit in (
                    (f"{VIEWERS} viewers", watched_s, COMMAND_TIMES),
                    (f"{VIEWERS} viewers of bad pictures", bad_s, COMMAND_TIMES),
                    (f"{VIEWERS} viewers, a new camera process starts", killed_s, None),
                )
            ),
        ]

    def _camera_processes(self) -> list[int]:
        return [
            child
            for bridge in process_stats.children(self._stack.supervisor.pid)
            for child in process_stats.children(bridge)
            if "robots.bridge.ros.camera" in process_stats.arguments(child)
        ]


def ages(
    name: str, measured: Measured, p50_ms: float | None = None, p95_ms: float | None = None
) -> list[Figure]:
    """Return p50 and p95 of the pictures' ages on the page, and the pictures shown per second."""
    return [
        Figure(f"{name}: age p50", measured.age_ms(0.50), "ms", p50_ms),
        Figure(f"{name}: age p95", measured.age_ms(0.95), "ms", p95_ms),
        Figure(f"{name}: pictures", measured.rate_hz, "/s"),
    ]
