"""The console's other tasks: Play to the robot's arm, live topics for ten browsers, a robot with 500 topics."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from itertools import count

import msgspec
from websockets.asyncio.client import ClientConnection, connect

from benchmarks.harness import Figure, progress, quantile
from benchmarks.parts import process_stats
from benchmarks.parts.chromium import topics_shown_s
from benchmarks.parts.observer import Observer, start_ros_side
from robots.shared import wire
from script.stack.client import Driver, sign_in
from script.stack.stack import Stack, temporary_stack

ROBOT = "tiago-1"
MOTION = "head_tour"  # moves no joint of the arm, so it is never refused because of obstacles
REPEATS = 40
PLAY_P50_MS = 10.0
BROWSERS = 10
LOOK_HZ = 10.0
LIVE_TOPIC, LIVE_HZ = "/bench_live", 100.0
MEASURED_S = 10.0
TOPICS = 500
FIRST_PAINT_S = 1.0


def measure() -> list[Figure]:
    """Start a console with three robots and use one."""
    with temporary_stack() as stack:
        return asyncio.run(measure_on(stack))


async def measure_on(stack: Stack) -> list[Figure]:
    """Return all figures, one phase after the other."""
    operator = await asyncio.to_thread(sign_in, stack, "operator")
    figures: list[Figure] = []
    async with Observer(stack.robots[ROBOT], "goals") as observer, Driver(stack, ROBOT, operator) as driver:
        progress("Play ...")
        figures += await play(driver, observer)
    progress(f"{BROWSERS} browsers look at {LIVE_HZ:.0f} Hz ...")
    live = start_ros_side(stack, stack.robots[ROBOT], "live")
    figures += await look(stack, operator)
    stack.release(live)
    progress(f"{TOPICS} topics in Chromium ...")
    many = start_ros_side(stack, stack.robots[ROBOT], "many")
    figures.append(
        Figure(
            f"{TOPICS} topics: first paint",
            await topics_shown_s(stack, ROBOT, operator, TOPICS),
            "s",
            FIRST_PAINT_S,
        )
    )
    stack.release(many)
    return figures


# --- play -----------------------------------------------------------------------------------------


async def play(driver: Driver, observer: Observer) -> list[Figure]:
    """Measure from the message on the public WebSocket to the goal at another node, with the audit commit."""
    await driver.take()
    await driver.until(lambda: driver.state and all(sensor.ok for sensor in driver.state.sensors))
    delays_s: list[float] = []
    for seq in range(1, REPEATS + 1):
        await driver.until(lambda: driver.state and driver.state.motion is None)
        observer.forget()
        fence = driver.fence or 0
        sent_s = time.monotonic()
        await driver.send(wire.Play(fence, MOTION, 2 * seq))
        await observer.until(lambda: observer.goals)
        delays_s.append(observer.goals[0] - sent_s)
        await driver.until(lambda: driver.state and driver.state.motion is not None)
        await driver.send(wire.PlayCancel(fence, 2 * seq + 1))
    return [
        Figure("Play to goal p50", 1000.0 * quantile(delays_s, 0.50), "ms", PLAY_P50_MS),
        Figure("Play to goal p99", 1000.0 * quantile(delays_s, 0.99), "ms"),
    ]


# --- live topics ----------------------------------------------------------------------------------


async def look(stack: Stack, cookie: str) -> list[Figure]:
    """Measure the cost of no, one and ten browsers that read one topic, and the rate that each gets."""
    [supervised] = [
        child
        for child in process_stats.children(stack.supervisor.pid)
        if process_stats.arguments(child)[-2:] == ["run_bridge", stack.robots[ROBOT].plan.slug]
    ]
    figures: list[Figure] = []
    for browsers in (0, 1, BROWSERS):
        async with AsyncExitStack() as looking:
            counters = [await looking.enter_async_context(looker(stack, cookie)) for _ in range(browsers)]
            await asyncio.sleep(2.0)
            shown = [next(counter) for counter in counters]
            began_s, bridge_s, inspector_s = (
                time.monotonic(),
                process_stats.cpu_s(supervised),
                inspector_cpu_s(supervised),
            )
            await asyncio.sleep(MEASURED_S)
            spent_s = time.monotonic() - began_s
            bridge = 100.0 * (process_stats.cpu_s(supervised) - bridge_s) / spent_s
            inspector = 100.0 * (inspector_cpu_s(supervised) - inspector_s) / spent_s
            figures += [
                Figure(f"{browsers} browsers: bridge", bridge, "%"),
                Figure(f"{browsers} browsers: inspector", inspector, "%"),
            ]
            if counters:
                rates = [
                    (next(counter) - before - 1) / spent_s
                    for counter, before in zip(counters, shown, strict=True)
                ]
                figures.append(Figure(f"{browsers} browsers: each sees", min(rates), "Hz"))
    return figures


def inspector_cpu_s(bridge: int) -> float:
    """Return the processor time of the inspector, which decodes messages; 0: there is no inspector."""
    return sum(process_stats.cpu_s(child) for child in process_stats.children(bridge))


@asynccontextmanager
async def looker(stack: Stack, cookie: str) -> AsyncIterator[count[int]]:
    """Context: a page that reads the live topic, and counts the messages that it gets."""
    address = f"{stack.url.replace('http', 'ws', 1)}/ws/robots/{ROBOT}/topics/"
    shown = count()
    async with connect(
        address,
        origin=stack.url,  # type: ignore[arg-type]
        additional_headers={"Cookie": cookie},
        compression=None,
    ) as socket:
        await socket.send(wire.encode(wire.Subscribe(LIVE_TOPIC, LOOK_HZ)), text=True)
        reader = asyncio.create_task(count_shown(socket, shown))
        try:
            yield shown
        finally:
            reader.cancel()


async def count_shown(socket: ClientConnection, shown: count[int]) -> None:
    """Acknowledge every view and draw nothing."""
    async for raw in socket:
        if msgspec.json.decode(raw).get("t") == "sample":
            next(shown)
            await socket.send(wire.encode(wire.Ack()), text=True)
