"""Many fleet pages in one process: `python -m benchmarks.growth.pages_side HOST PORT ORIGIN COUNT`.

The process reads the Cookie headers from stdin (separated by tabs; pages use them in turn), opens the pages, and
acknowledges each update and pings each second, as a page does. It prints "ready", then each second the bytes of all
messages so far.

In a lab each page is on a computer of its own. Here they get only the processor time that the console leaves.
"""

from __future__ import annotations

import asyncio
import os
import random
import sys
import time

from benchmarks.parts.crowd import Page, frame, upgrade
from robots.shared import wire

UPDATE = b'{"t":"fleet"'
PING_S = 1.0


class FleetPages:
    """The bytes that all pages have received."""

    received_bytes = 0

    def hello(self) -> bytes:
        """Return the first frame."""
        return frame(wire.encode(wire.Ping(0.0)))

    def seen(self, message: bytes) -> None:
        """Count a message."""
        self.received_bytes += len(message)


class FleetPage(Page):
    """A fleet page that draws nothing."""

    def _next(self) -> bytes | None:
        text = super()._next()
        if text is not None and text.startswith(UPDATE):
            self.send(_ACK)
        return text


_ACK = frame(wire.encode(wire.Ack()))


async def ping(page: FleetPage) -> None:
    """Ping once a second, from a random moment on."""
    await asyncio.sleep(PING_S * random.random())  # noqa: S311
    while True:
        page.send(frame(wire.encode(wire.Ping(time.monotonic() * 1000.0))))
        await asyncio.sleep(PING_S)


async def main() -> None:
    """Run until killed."""
    os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    host, port, origin, count = sys.argv[1:]
    cookies = sys.stdin.readline().strip().split("\t")
    loop = asyncio.get_running_loop()
    shown = FleetPages()
    pings = []
    for number in range(int(count)):
        request = upgrade(host, port, "/ws/fleet/", origin, cookies[number % len(cookies)])
        page = FleetPage(number, request, shown, stalls=False)  # type: ignore[arg-type]
        await loop.create_connection(lambda page=page: page, host, int(port))  # type: ignore[misc]
        await page.opened
        pings.append(asyncio.ensure_future(ping(page)))
    print("ready", flush=True)
    while True:
        await asyncio.sleep(1.0)
        print(shown.received_bytes, flush=True)


if __name__ == "__main__":
    asyncio.run(main())
