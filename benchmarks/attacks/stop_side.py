"""Floods of stops at the web port: ``python -m benchmarks.attacks.stop_side ROLE SECONDS HOST PORT ORIGIN``.

ATTACK_CROWD in the environment has the people of `benchmarks.attacks.people`: strangers see no robot, colleagues may
stop all of them. Requests are made once, because the attackers share the processor with the console.
"""

from __future__ import annotations

import asyncio
import json
import os
import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import count, cycle
from typing import NamedTuple

from benchmarks.attacks.web_side import FAULTS, UPGRADE, Target

ONE = ("127.0.0.2",)
TWO = ("127.0.0.2", "127.0.0.3")
MANY = tuple(f"127.0.0.{last}" for last in range(2, 42))
CONNECTIONS = 400
SLOW_S = 10.0  # an open request is left open for this time
FAULT_S = 0.05

Crowd = Mapping[str, Sequence[Mapping[str, str]]]
Requests = Iterator[bytes]


class Flood(NamedTuple):
    """Connections from some addresses that send one of the requests each, and another after each answer."""

    addresses: Sequence[str]
    requests: Callable[[Target, Crowd, str], Requests]  # the last argument: the name of the session cookie
    connections: int = CONNECTIONS
    answer_s: float = 30.0  # the longest wait for an answer


def _sessions(kind: str, number: int) -> Callable[[Target, Crowd, str], Requests]:
    def requests(target: Target, crowd: Crowd, _cookie: str) -> Requests:
        return cycle(
            target.head("POST", "/api/v1/stop", f"X-CSRFToken: {one['csrf']}", EMPTY, cookie=one["cookie"])
            + b"\r\n"
            for one in crowd[kind][:number]
        )

    return requests


def _tokens(kind: str, number: int) -> Callable[[Target, Crowd, str], Requests]:
    def requests(target: Target, crowd: Crowd, _cookie: str) -> Requests:
        return cycle(
            target.head("POST", "/api/v1/stop", f"Authorization: Bearer {one['token']}", EMPTY) + b"\r\n"
            for one in crowd[kind][:number]
        )

    return requests


def _invented_sessions(target: Target, _crowd: Crowd, cookie: str) -> Requests:
    for number in count():
        yield target.head("POST", "/stop-all/", EMPTY, cookie=f"{cookie}={number:032}") + b"\r\n"


def _invented_tokens(target: Target, _crowd: Crowd, _cookie: str) -> Requests:
    for number in count():
        token = f"Authorization: Bearer fleet_{number:043}"
        yield target.head("POST", "/api/v1/stop", token, EMPTY) + b"\r\n"


def _open(target: Target, _crowd: Crowd, _cookie: str) -> Requests:
    return cycle([target.head("GET", "/accounts/sign-in/") + b"\r\n"])


def _handshakes(target: Target, _crowd: Crowd, cookie: str) -> Requests:
    for number in count():
        cookies = f"{cookie}={number:032}"
        yield target.head("GET", "/ws/robots/tiago-1/", *UPGRADE, cookie=cookies) + b"\r\n"


EMPTY = "Content-Length: 0"
ROLES = {
    "stranger": Flood(ONE, _sessions("strangers", 1)),
    "strangers": Flood(MANY, _sessions("strangers", 10)),
    "stranger-tokens": Flood(MANY, _tokens("strangers", 10)),
    "invented-sessions": Flood(MANY, _invented_sessions),
    "invented-tokens": Flood(ONE, _invented_tokens),
    "colleague": Flood(ONE, _sessions("colleagues", 1)),
    "colleagues": Flood(MANY, _sessions("colleagues", 10)),
    "colleague-tokens": Flood(MANY, _tokens("colleagues", 10)),
    "open-requests": Flood(TWO, _open, 440, SLOW_S),
    "invented-sockets": Flood(MANY, _handshakes, 200),
}


async def attack(flood: Flood, target: Target, crowd: Crowd, seconds: float) -> None:
    """Keep the connections of a flood busy until the time is over, or SIGTERM."""
    cookie = crowd["strangers"][0]["cookie"]
    name = next(part for part in cookie.replace("=", "; ").split("; ") if part.startswith("fleet_session"))
    requests = flood.requests(target, crowd, name)

    async def keep(source: str) -> None:
        while True:
            try:
                await _talk(target, source, requests, flood.answer_s)
            except FAULTS as error:
                target.count(type(error).__name__)
                await asyncio.sleep(FAULT_S)

    sources = [flood.addresses[place % len(flood.addresses)] for place in range(flood.connections)]
    talking = asyncio.gather(*map(keep, sources))
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, talking.cancel)
    with suppress(asyncio.CancelledError, asyncio.TimeoutError):
        await asyncio.wait_for(talking, seconds)


async def _talk(target: Target, source: str, requests: Requests, answer_s: float) -> None:
    """Send requests on one connection, until the console closes it."""
    async with target.connected(source) as (reader, writer):
        while True:
            writer.write(next(requests))
            head = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), answer_s)
            target.count(head[9:12].decode(errors="replace"))
            lines = dict(line.partition(b":")[::2] for line in head.lower().split(b"\r\n"))
            await reader.readexactly(int(lines.get(b"content-length", b"0")))
            if b"close" in lines.get(b"connection", b"") or b"upgrade" in lines:
                break


def main() -> None:
    """Run the role of the first argument."""
    role, seconds, host, port, origin = sys.argv[1:]
    target = Target(host, int(port), origin)
    crowd = json.loads(os.environ["ATTACK_CROWD"])
    os.nice(10)  # an attacker usually has its own computer
    asyncio.run(attack(ROLES[role], target, crowd, float(seconds)))
    print(" ".join(f"{what}:{number}" for what, number in sorted(target.done.items())), flush=True)


if __name__ == "__main__":
    main()
