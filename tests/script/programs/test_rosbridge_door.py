"""The rosbridge door of a whole console: a simulated robot drives, stops, and is lost, as its clients publish."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed

from robots.shared import wire
from script.stack.client import Driver, sign_in
from script.stack.stack import PRACTICE_ROBOTS
from tests.script.programs.rosbridge_client import RosbridgeClient
from tests.script.support import token

ROBOT = PRACTICE_ROBOTS[0].slug
PERIOD_S = 0.05
LONGEST_S = 20.0


@pytest.fixture
def client(stack) -> Callable[[str], RosbridgeClient]:
    """`client("operator")`: that person's client."""
    return lambda role: RosbridgeClient(stack, ROBOT, token(stack, role, "drive", "topics", name="lab"))


@pytest.fixture
def page(stack) -> Callable[[str], Driver]:
    """`page("observer")`: that person's page, which sees how the robot moves."""
    return lambda role: Driver(stack, ROBOT, sign_in(stack, role))


def turns(page: Driver) -> bool:
    """Return whether the page sees the robot turn; its first view may not be here yet."""
    return page.odometry is not None and page.odometry.w > 0.2


async def turn_until(client: RosbridgeClient, holds: Callable[[], Any], *, lets_go: bool = True) -> None:
    """Publish a turn until this holds; `lets_go`: after a refusal, which a busy computer causes too, zero first."""
    end_s, told = time.monotonic() + LONGEST_S, len(client.status)
    while not holds():
        assert time.monotonic() < end_s, client.status
        with suppress(ConnectionClosed):
            await client.drive(0.0, 0.0 if lets_go and len(client.status) > told else 0.4)
        told = len(client.status)
        await asyncio.sleep(PERIOD_S)


async def test_a_client_drives_and_its_silence_stops_the_robot(client, page):
    async with page("observer") as seen, client("operator") as driver:
        await driver.call("/fleet/take_control")
        await turn_until(driver, lambda: turns(seen))
        silent_s = time.monotonic()
        await seen.until(lambda: abs(seen.odometry.w) < 0.02)
        assert time.monotonic() - silent_s < LONGEST_S / 4
        driver.status.clear()
        await turn_until(driver, lambda: driver.status, lets_go=False)
        await driver.told("neutral_needed")
        assert abs(seen.odometry.w) < 0.02
        await turn_until(driver, lambda: turns(seen))


async def test_a_stop_by_anybody_stops_a_client_that_drives(client, page):
    async with page("observer") as seen, client("operator") as driver, client("observer") as other:
        await driver.call("/fleet/take_control")
        await turn_until(driver, lambda: turns(seen))
        driving = asyncio.create_task(turn_until(driver, lambda: False))
        await other.call("/fleet/stop")
        await driver.told("stopped")
        await seen.until(lambda: abs(seen.odometry.w) < 0.02)
        driving.cancel()
        async with page("supervisor") as supervisor:
            await supervisor.until(lambda: supervisor.state and supervisor.state.stop.state == "stopped")
            await supervisor.clear()


async def test_control_that_is_lost_while_driving_is_told(client, page):
    async with page("supervisor") as supervisor, client("operator") as driver:
        await driver.call("/fleet/take_control")
        await turn_until(driver, lambda: turns(supervisor))
        driving = asyncio.create_task(turn_until(driver, lambda: False))
        await supervisor.send(wire.TakeOver("inspection"))
        await driver.told("no_lease")
        await supervisor.until(lambda: abs(supervisor.odometry.w) < 0.02)
        driving.cancel()
        await supervisor.release()


async def test_a_client_without_anything_to_send_keeps_control(client):
    async with client("operator") as driver, client("supervisor") as other:
        await driver.call("/fleet/take_control")
        await asyncio.sleep(6.0)  # a page that is silent for 5 s counts as lost
        assert (await other.ask("/fleet/take_control"))["values"].startswith("held: ")
    async with client("supervisor") as other:  # and it ends with the connection
        await other.call("/fleet/take_control")


async def test_a_frame_of_a_megabyte_closes_with_its_reason(client):
    async with client("operator") as driver:
        await driver.call("/fleet/take_control")
        await driver.send({"op": "publish", "topic": "/cmd_vel", "id": "x" * 1_000_000})
        await driver.socket.wait_closed()
        assert driver.socket.close_code == 1009
    async with client("operator") as driver:
        await driver.call("/fleet/take_control")


async def test_a_client_that_stops_reading_harms_nobody_and_still_stops(client, page):
    """Its connection holds some pictures of a megabyte, then it is behind."""
    async with client("operator") as slow, client("observer") as other, page("supervisor") as supervisor:
        for one in (slow, other):
            await one.send({"op": "subscribe", "topic": "/xtion/rgb/image_raw", "queue_length": 1})
            await one.send({"op": "subscribe", "topic": "/scan_raw", "throttle_rate": 0})
            await one.until(lambda one=one: any(message["topic"] == "/scan_raw" for message in one.messages))
        slow.pause()
        for _ in range(3):
            other.messages.clear()
            await other.until(lambda: len(other.messages) > 20)
        await slow.send({"op": "call_service", "service": "/fleet/stop", "id": "stop"})
        await supervisor.until(lambda: supervisor.state.stop.state != "clear")
        slow.messages.clear()
        slow.resume()
        newest = _stamp(other.messages[-1])
        await slow.until(lambda: any(_stamp(message) >= newest for message in slow.messages))
        await supervisor.until(lambda: supervisor.state.stop.state == "stopped")
        await supervisor.clear()


def _stamp(message: dict[str, Any]) -> float:
    stamp = message["msg"]["header"]["stamp"]
    return float(stamp["secs"]) + 1e-9 * float(stamp["nsecs"])
