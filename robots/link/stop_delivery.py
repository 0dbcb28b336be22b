"""Sends an emergency stop to the robot's bridge and watchdog at the same time; the first confirmation counts.

The stop is the first message of each connection. It contains the robot's id, so the sender need not wait for the
bridge's hello.
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import Coroutine, Sequence
from pathlib import Path
from typing import Any, TypeVar
from uuid import UUID

import msgspec
from websockets.exceptions import ConnectionClosed, InvalidHandshake

from robots.link.connections import LinkRefused, down, open_link, why_down
from robots.shared import wire
from robots.shared.configuration.bridge_config import LinkAddress
from robots.shared.wire import LinkStop, Refusal, Refused, Stopped

STOP_S = 2.0  # a stop that is not confirmed after this time is pending
NUMBERED_S = 0.1  # a bridge that runs answers within milliseconds
LONGEST_TEXT = 200  # characters of names and reasons, as in wire.ShortText

SILENT = Refusal("bridge_silent", "The robot’s bridge did not answer in time.", "robot")

T = TypeVar("T")
Answer = Coroutine[Any, Any, Stopped | Refusal]


def stop_message(robot: UUID | None, by: str, reason: str = "", press: UUID | None = None) -> LinkStop:
    """Return a stop message; its texts are cut to the allowed length."""
    return LinkStop(by[:LONGEST_TEXT], reason[:LONGEST_TEXT], robot=robot, press=press)


async def reach(address: LinkAddress, stop: LinkStop) -> Stopped | Refusal:
    """Send `stop` over new connections. Returns the answer; raises LinkRefused if there is none."""
    return await first_answer([ask_watchdog(address, stop), ask_bridge(address, stop)], STOP_S)


async def first_answer(ways: Sequence[Answer], within_s: float) -> Stopped | Refusal:
    """Return the first confirmation, or else a refusal. Without either, raise LinkRefused with the last way's reason.

    Put the quickest way first: the start of each way delays the ways after it. A confirmation of the watchdog, which
    does not number stops, waits up to `NUMBERED_S` for that of the bridge: by its number the stop is cleared.
    """
    loop = asyncio.get_running_loop()
    end_s = loop.time() + within_s
    tasks = [loop.create_task(way) for way in ways]
    left = set(tasks)
    refusal: Refusal | None = None
    unnumbered: Stopped | None = None
    try:
        while left and (remaining_s := end_s - loop.time()) > 0:
            done, left = await asyncio.wait(left, timeout=remaining_s, return_when="FIRST_COMPLETED")
            for task in done:
                answer = None if task.exception() else task.result()
                if isinstance(answer, Stopped) and answer.stop.number:
                    return answer
                if isinstance(answer, Stopped):
                    unnumbered, end_s = answer, min(end_s, loop.time() + NUMBERED_S)
                else:
                    refusal = answer or refusal
    finally:
        for task in left:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    if unnumbered is not None:
        return unnumbered
    if refusal is not None:
        return refusal
    error = None if tasks[-1].cancelled() else tasks[-1].exception()
    raise error if isinstance(error, LinkRefused) else LinkRefused(SILENT) from error


async def ask_bridge(address: LinkAddress, stop: LinkStop) -> Stopped | Refusal:
    """Send `stop` to the robot's bridge. Raises LinkRefused if the bridge cannot be reached."""
    try:
        async with open_link(address) as link:
            try:
                await link.send(wire.encode(stop), text=True)
                while True:
                    if (answer := answer_of(await link.recv())) is not None:
                        return answer
            finally:
                link.transport.abort()  # no closing handshake: the bridge may be frozen
    except (TimeoutError, OSError, InvalidHandshake, ConnectionClosed) as error:
        raise LinkRefused(why_down(error, address)) from error


async def ask_watchdog(address: LinkAddress, stop: LinkStop) -> Stopped | Refusal:
    """Send `stop` to the watchdog of a bridge on this computer. Raises LinkRefused if there is none."""
    if not address.unix_path:
        raise LinkRefused(down(address))
    loop = asyncio.get_running_loop()
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as lane:
            lane.setblocking(False)
            await loop.sock_connect(lane, str(Path(address.unix_path).with_suffix(".stop")))
            await loop.sock_sendall(lane, wire.encode(stop))
            answer = answer_of(await loop.sock_recv(lane, wire.LARGEST_MESSAGE_BYTES))
    except OSError as error:
        raise LinkRefused(why_down(error, address)) from error
    if answer is None:
        raise LinkRefused(SILENT)
    return answer


def answer_of(raw: str | bytes) -> Stopped | Refusal | None:
    """Return the answer to a stop; None for any other message."""
    with contextlib.suppress(msgspec.DecodeError, UnicodeError):
        report = wire.link_report(raw)
        if isinstance(report, Stopped):
            return report
        if isinstance(report, Refused):
            return report.refusal
    return None


def wait_for(work: Coroutine[Any, Any, T]) -> T:
    """Run `work` from code without an event loop. Does not wait for the loop's helper threads (name resolution)."""
    loop = asyncio.new_event_loop()
    try:
        return loop.run_until_complete(work)
    finally:
        loop.close()
