"""Incidents that end, freeze or replace a bridge; the stop is pressed while the bridge is away."""

from __future__ import annotations

import asyncio
import os
import signal
import xmlrpc.client
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import NamedTuple

from benchmarks.driving.stop import ROBOT, bridges
from script.stack.stack import Stack
from tests.ros.strangers import BRIDGE, Node, bridge_uri

FROZEN_S = 3.0


class Incident(NamedTuple):
    """`strike` returns an async function that undoes the incident.

    `presses_s`: seconds from strike to each press.
    """

    strike: Callable[[Stack], Awaitable[Callable[[], Awaitable[None]]]]
    presses_s: tuple[float, ...]
    fresh_supervisor: bool = False  # a new supervisor afterwards: the old one's restart budget is used up


async def freeze(stack: Stack) -> Callable[[], Awaitable[None]]:
    """Stop the bridges with SIGSTOP for three seconds."""
    frozen = bridges(stack)
    for bridge in frozen:
        os.kill(bridge, signal.SIGSTOP)
    thaw = asyncio.get_running_loop().call_later(FROZEN_S, _continue, frozen)

    async def undo() -> None:
        await asyncio.sleep(max(0.0, thaw.when() - asyncio.get_running_loop().time()))
        _continue(frozen)

    return undo


def _continue(frozen: list[int]) -> None:
    for bridge in frozen:
        with suppress(ProcessLookupError):
            os.kill(bridge, signal.SIGCONT)


async def kill(stack: Stack) -> Callable[[], Awaitable[None]]:
    for bridge in bridges(stack):
        os.kill(bridge, signal.SIGKILL)
    return _nothing


async def shut_down(stack: Stack) -> Callable[[], Awaitable[None]]:
    """Call the node's shutdown method, as a stranger can."""
    await asyncio.to_thread(_shut_down, stack.robots[ROBOT].master_uri)
    return _nothing


def _shut_down(master_uri: str) -> None:
    with suppress(OSError, LookupError, xmlrpc.client.Error):
        xmlrpc.client.ServerProxy(bridge_uri(master_uri)).shutdown("/stranger", "because I can")


async def take_name(stack: Stack) -> Callable[[], Awaitable[None]]:
    """Register a node with the bridge's name, and end it at once: the master asks the bridge to shut down."""
    await asyncio.to_thread(_take_name, stack.robots[ROBOT].master_uri)
    return _nothing


def _take_name(master_uri: str) -> None:
    with Node(master_uri, BRIDGE) as node:
        node.publish("/somewhere", "std_msgs/String")


async def _nothing() -> None: ...


INCIDENTS = {
    "frozen": Incident(freeze, (0.1, 1.0, 2.0)),
    "killed": Incident(kill, (0.05, 0.3, 0.8), fresh_supervisor=True),
    "shutdown-call": Incident(shut_down, (0.05, 0.3, 0.8)),
    "same-name": Incident(take_name, (0.05, 0.3, 0.8)),
}
