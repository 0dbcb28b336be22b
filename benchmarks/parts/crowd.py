"""Many viewers of one robot, in a separate process:

    python -m benchmarks.parts.crowd HOST PORT SLUG ORIGIN COUNT [--camera NAME] [--stall]

The process reads a line of Cookie headers from stdin (separated by tabs; pages use them in turn), opens COUNT
control pages and acknowledges every view. It prints "ready", then for every view and viewer a line: viewer's
number, arrival (monotonic ns), checksum of the view. With --camera it opens camera sockets instead and prints
the pictures' numbers; lines "watch" and "end" of stdin begin and end watching. With --topic it opens clients of the
rosbridge door, which subscribe to this topic, and prints the messages' stamps (ns); instead of Cookie headers it reads
tokens (`Bearer ...`). With --stall the last viewer
sends its first message and then reads nothing at all.

Fifty WebSockets of a library would keep this process busier than the measured console, so a page here does the
minimum. It assumes that the console sends no fragments.
"""

from __future__ import annotations

import argparse
import asyncio
import re
import secrets
import sys
import time
import zlib

import msgspec

from robots.shared import wire

VIEW = b'{"t":"view"'
_TEXT = 0x81
_CLOSE = 0x88
_MASKED = 0x80
_NO_MASK = bytes(4)  # masking with zeros leaves the bytes unchanged


def frame(text: bytes) -> bytes:
    """Return a client's text frame of fewer than 126 bytes."""
    return bytes((_TEXT, _MASKED | len(text))) + _NO_MASK + text


class Views:
    """Views of a control page."""

    path = "/ws/robots/{slug}/"
    _acknowledge = frame(wire.encode(wire.Ack()))

    def hello(self) -> bytes:
        """Return the first frame."""
        return frame(wire.encode(wire.Hello(secrets.token_urlsafe(24))))

    def seen(self, message: bytes) -> tuple[int, bytes] | None:
        """Return the view's checksum, and the answer; None for other messages."""
        return (zlib.crc32(message), self._acknowledge) if message.startswith(VIEW) else None


class Pictures:
    """Pictures of one camera."""

    path = "/ws/robots/{slug}/camera/"

    def __init__(self, camera: str) -> None:
        self._camera = camera
        self.watch = frame(wire.encode(wire.CameraWatch(camera)))
        self.end = frame(wire.encode(wire.CameraEnd(camera)))

    def hello(self) -> bytes:
        """Return the first frame."""
        return self.watch

    def seen(self, message: bytes) -> tuple[int, bytes] | None:
        """Return the picture's number, and the answer; None for messages without a picture."""
        if message.startswith(b"{"):
            return None
        header = msgspec.json.decode(
            message[4 : 4 + int.from_bytes(message[:4], "big")], type=wire.PictureHeader
        )
        return header.number, frame(wire.encode(wire.CameraAck(self._camera, header.number)))


class Topic:
    """Messages of one topic, to a client of the rosbridge door."""

    path = "/rosbridge/{slug}"
    _stamp = re.compile(rb'"stamp":\{"secs?":(\d+),"n(?:ano)?secs?":(\d+)\}')  # of ROS 1 or 2

    def __init__(self, topic: str) -> None:
        self.watch = frame(msgspec.json.encode({"op": "subscribe", "topic": topic}))
        self.end = frame(msgspec.json.encode({"op": "unsubscribe", "topic": topic}))

    def hello(self) -> bytes:
        """Return the first frame."""
        return self.watch

    def seen(self, message: bytes) -> tuple[int, bytes] | None:
        """Return the message's stamp; no answer is needed. None for other operations."""
        found = self._stamp.search(message, 0, 500)
        return (int(found[1]) * 1_000_000_000 + int(found[2]), b"") if found else None


Shown = Views | Pictures | Topic


class Page(asyncio.Protocol):
    """A page that draws nothing."""

    def __init__(self, number: int, request: bytes, shown: Shown, *, stalls: bool) -> None:
        self._number = number
        self._request = request
        self._shown = shown
        self._stalls = stalls
        self._received = bytearray()
        self.opened: asyncio.Future[None] = asyncio.get_running_loop().create_future()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Request a WebSocket."""
        assert isinstance(transport, asyncio.Transport)  # noqa: S101 - it is TCP
        self._transport = transport
        transport.write(self._request)

    def data_received(self, data: bytes) -> None:
        """Answer and print complete messages."""
        now_ns = time.monotonic_ns()
        self._received += data
        if not self.opened.done():
            self._open()
        while self.opened.done() and (text := self._next()) is not None:
            if (seen := self._shown.seen(text)) is not None:
                self._transport.write(seen[1])
                sys.stdout.write(f"{self._number} {now_ns} {seen[0]}\n")

    def send(self, text_frame: bytes) -> None:
        self._transport.write(text_frame)

    def _open(self) -> None:
        head, end, rest = bytes(self._received).partition(b"\r\n\r\n")
        if not end:
            return
        if b" 101 " not in head.partition(b"\r\n")[0]:
            raise ConnectionRefusedError(head.decode())
        self._received = bytearray(rest)
        self._transport.write(self._shown.hello())
        if self._stalls:
            self._transport.pause_reading()
        self.opened.set_result(None)

    def _next(self) -> bytes | None:
        """Return the next complete message, None if there is none yet."""
        received = self._received
        if len(received) < 2:
            return None
        if received[0] == _CLOSE:
            self._transport.close()
            return None
        begin, length = 2, received[1]
        if length == 126:
            begin, length = 4, int.from_bytes(received[2:4], "big")
        elif length == 127:
            begin, length = 10, int.from_bytes(received[2:10], "big")
        if len(received) < begin + length:
            return None
        message = bytes(memoryview(received)[begin : begin + length])
        del received[: begin + length]
        return message


def upgrade(host: str, port: str, path: str, origin: str, key: str) -> bytes:
    """Return the request that opens a WebSocket."""
    lines = (
        f"GET {path} HTTP/1.1",
        f"Host: {host}:{port}",
        *(
            (f"Authorization: {key}",)
            if key.startswith("Bearer ")
            else (f"Origin: {origin}", f"Cookie: {key}")
        ),
        "Connection: Upgrade",
        "Upgrade: websocket",
        "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
    )
    return "\r\n".join((*lines, "", "")).encode()


async def main() -> None:
    """Run until killed."""
    parser = argparse.ArgumentParser()
    for word in ("host", "port", "slug", "origin"):
        parser.add_argument(word)
    parser.add_argument("count", type=int)
    parser.add_argument("--camera")
    parser.add_argument("--topic")
    parser.add_argument("--stall", action="store_true")
    asked = parser.parse_args()
    shown: Shown = Views()
    if asked.camera or asked.topic:
        shown = Pictures(asked.camera) if asked.camera else Topic(asked.topic)
    path = shown.path.format(slug=asked.slug)
    requests = [
        upgrade(asked.host, asked.port, path, asked.origin, key)
        for key in sys.stdin.readline().strip().split("\t")
    ]
    loop = asyncio.get_running_loop()
    pages = []
    for number in range(asked.count):
        stalls = asked.stall and number == asked.count - 1
        page = Page(number, requests[number % len(requests)], shown, stalls=stalls)
        await loop.create_connection(lambda page=page: page, asked.host, int(asked.port))  # type: ignore[misc]
        await page.opened
        pages.append(page)
    if not isinstance(shown, Views):
        loop.add_reader(sys.stdin, obey, pages, {"watch": shown.watch, "end": shown.end})
    print("ready", flush=True)
    while True:  # write records in blocks: writing must not affect the measurement
        await asyncio.sleep(0.2)
        sys.stdout.flush()


def obey(pages: list[Page], frames: dict[str, bytes]) -> None:
    """Carry out the next line of stdin on all pages."""
    word = sys.stdin.readline().strip()
    for page in pages:
        page.send(frames[word])


if __name__ == "__main__":
    asyncio.run(main())
