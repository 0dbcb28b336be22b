"""Stops over HTTP at a real server: all request forms, and frozen bridge and watchdog."""

from __future__ import annotations

import asyncio
import http.client
import json
import os
import signal
import time
from pathlib import Path

from script.stack.client import DRIVE_PERIOD_S, Driver, sign_in
from script.stack.stack import PRACTICE_ROBOTS, Stack

ROBOT = PRACTICE_ROBOTS[0].slug
PATIENCE_S = 30.0
STANDS_MPS = 0.01


def motion_processes(stack: Stack) -> list[int]:
    """The robot's bridge and its watchdog."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            command = (process / "cmdline").read_bytes()
            environment = (process / "environ").read_bytes()
        except OSError:  # the process has ended, or belongs to another account
            continue
        if stack.environment["FLEET_VAR"].encode() in environment and (
            b"run_bridge" in command or b"watchdog" in command
        ):
            found.append(int(process.name))
    return found


def post(
    stack: Stack, cookie: str, path: str, body: bytes = b"", **headers: str
) -> tuple[int, dict[str, object]]:
    token = next(part.partition("=")[2] for part in cookie.split("; ") if part.startswith("fleet_csrf"))
    connection = http.client.HTTPConnection("127.0.0.1", stack.port, timeout=PATIENCE_S)
    try:
        connection.request("POST", path, body, {"Cookie": cookie, "X-CSRFToken": token, **headers})
        answer = connection.getresponse()
        return answer.status, json.loads(answer.read())
    finally:
        connection.close()


def test_no_form_of_a_stop_is_refused_by_the_real_server(stack: Stack) -> None:
    cookie = sign_in(stack, "observer")
    kinds = {"Accept": "application/xml"}, {"Content-Type": "text/plain; charset=none"}, {"Accept": ";;/"}
    for path in ("/api/v1/stop", "/api/v1/stop/?format=xml", f"/api/v1/robots/{ROBOT}/stop"):
        for headers in kinds:
            status, result = post(stack, cookie, path, b"{", **headers)
            assert (status, list(result["robots"])) == (200, [ROBOT]), (path, headers)  # type: ignore[call-overload]
    asyncio.run(clear_and_leave(stack))


async def clear_and_leave(stack: Stack) -> None:
    """Clear the stop for the other tests of the console."""
    async with Driver(stack, ROBOT, await asyncio.to_thread(sign_in, stack, "operator")) as driver:
        await driver.take()
        await driver.until(lambda: driver.state and driver.state.stop.state == "stopped")
        await driver.clear()
        await driver.release()


async def test_a_stop_of_a_frozen_robot_is_pending_then_holds(stack: Stack) -> None:
    driving, watching = sign_in(stack, "operator"), sign_in(stack, "observer")
    async with Driver(stack, ROBOT, driving) as driver:
        await driver.take()
        await driver.until(lambda: driver.state)
        await driver.hold_stick(0.0, 0.5, until=lambda: driver.odometry and abs(driver.odometry.w) > 0.1)
        frozen = motion_processes(stack)
        assert len(frozen) >= 2
        holding = asyncio.create_task(hold(driver))
        for process in frozen:
            os.kill(process, signal.SIGSTOP)
        try:
            status, result = await asyncio.to_thread(post, stack, watching, f"/api/v1/robots/{ROBOT}/stop/")
        finally:
            for process in frozen:
                os.kill(process, signal.SIGCONT)
        assert status == 202
        assert result["robots"][ROBOT]["pending"]  # type: ignore[index]
        try:
            await driver.until(lambda: driver.state and driver.state.stop.state == "stopped", PATIENCE_S)
            assert driver.odometry and abs(driver.odometry.w) < STANDS_MPS
            spool = Path(stack.environment["FLEET_VAR"]) / "run" / "stops"
            end_s = time.monotonic() + PATIENCE_S
            while list(spool.glob("*.json")):
                assert time.monotonic() < end_s, "the stop still waits"
                await asyncio.sleep(0.1)
        finally:
            holding.cancel()
        await driver.clear()
        await driver.release()


async def hold(driver: Driver) -> None:
    """Send drive input like a page with a held stick."""
    while True:
        await driver.drive(0.0, 0.5)
        await asyncio.sleep(DRIVE_PERIOD_S)
