"""Many viewers of one robot, in a separate process:

    python -m benchmarks.parts.crowd HOST PORT SLUG ORIGIN COUNT [--stall]

reads a Cookie header from stdin, opens COUNT control pages and acknowledges every view. It prints "ready", then
for every view and viewer a line: viewer's number, arrival (monotonic ns), checksum of the view. With --stall
the last viewer says hello and then reads nothing at all.

Fifty WebSockets of a library would keep this process busier than the measured console, so a page here does the minimum.
It assumes that the console sends no fragments.
"""

from __future__ import annotations

import asyncio
import secrets
import sys
import time
import zlib

from robots import wire

VIEW = b'{"t":"view"'
_TEXT = 0x81
_MASKED = 0x80
_NO_MASK = bytes(4)  # masking with zeros leaves the bytes unchanged


def frame(text: bytes) -> bytes:
    """Return a client's text frame of fewer than 126 bytes."""
    return bytes((_TEXT, _MASKED | len(text))) + _NO_MASK + text


ACKNOWLEDGE = frame(wire.encode(wire.Ack()))


class Page(asyncio.Protocol):
    """A control page that draws nothing."""

    def __init__(self, number: int, request: bytes, *, stalls: bool) -> None:
        self._number = number
        self._request = request
        self._stalls = stalls
        self._received = b""
        self.opened: asyncio.Future[None] = asyncio.get_running_loop().create_future()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Request a WebSocket."""
        assert isinstance(transport, asyncio.Transport)  # noqa: S101 - it is TCP
        self._transport = transport
        transport.write(self._request)

    def data_received(self, data: bytes) -> None:
        """Handle complete messages."""
        now_ns = time.monotonic_ns()
        self._received += data
        if not self.opened.done():
            self._open()
        while self.opened.done() and (text := self._next()) is not None:
            if text.startswith(VIEW):
                self._transport.write(ACKNOWLEDGE)
                sys.stdout.write(f"{self._number} {now_ns} {zlib.crc32(text)}\n")

    def _open(self) -> None:
        head, end, rest = self._received.partition(b"\r\n\r\n")
        if not end:
            return
        if b" 101 " not in head.partition(b"\r\n")[0]:
            raise ConnectionRefusedError(head.decode())
        self._received = rest
        self._transport.write(frame(wire.encode(wire.Hello(secrets.token_urlsafe(24)))))
        if self._stalls:
            self._transport.pause_reading()
        self.opened.set_result(None)

    def _next(self) -> bytes | None:
        """Return the next complete message, None if there is none yet."""
        received = self._received
        if len(received) < 2:
            return None
        begin, length = 2, received[1]
        if length == 126:
            begin, length = 4, int.from_bytes(received[2:4], "big")
        if len(received) < begin + length:
            return None
        self._received = received[begin + length :]
        return received[begin : begin + length]


def upgrade(host: str, port: str, slug: str, origin: str, cookie: str) -> bytes:
    """Return the request that opens a WebSocket."""
    lines = (
        f"GET /ws/robots/{slug}/ HTTP/1.1",
        f"Host: {host}:{port}",
        f"Origin: {origin}",
        f"Cookie: {cookie}",
        "Connection: Upgrade",
        "Upgrade: websocket",
        "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
    )
    return "\r\n".join((*lines, "", "")).encode()


async def main() -> None:
    """Run until killed."""
    host, port, slug, origin, count, *rest = sys.argv[1:]
    request = upgrade(host, port, slug, origin, sys.stdin.readline().strip())
    loop = asyncio.get_running_loop()
    for number in range(int(count)):
        stalls = "--stall" in rest and number == int(count) - 1
        page = Page(number, request, stalls=stalls)
        await loop.create_connection(lambda page=page: page, host, int(port))  # type: ignore[misc]
        await page.opened
    print("ready", flush=True)
    while True:  # write records in blocks: writing must not affect the measurement
        await asyncio.sleep(0.2)
        sys.stdout.flush()


if __name__ == "__main__":
    asyncio.run(main())
