"""Many viewers of one robot, in a process of their own:

    python -m benchmarks.parts.crowd ADDRESS ORIGIN COUNT [--stall]

reads a Cookie header from stdin, opens COUNT control pages and acknowledges every view. It prints "ready", then
for every view and viewer a line: viewer's number, arrival (monotonic ns), checksum of the view. With --stall
the last viewer says hello and then reads nothing at all.
"""

from __future__ import annotations

import asyncio
import secrets
import sys
import time
import zlib

from websockets.asyncio.client import ClientConnection, connect

from robots import wire

ACKNOWLEDGE = wire.encode(wire.Ack()).decode()
VIEW = b'{"t":"view"'


async def open_page(address: str, origin: str, cookie: str) -> ClientConnection:
    """A page that has said hello."""
    page = await connect(
        address,
        origin=origin,  # type: ignore[arg-type]
        additional_headers={"Cookie": cookie},
        compression=None,
        ping_interval=None,
        max_queue=None,
    )
    await page.send(wire.encode(wire.Hello(secrets.token_urlsafe(24))), text=True)
    return page


async def look(number: int, page: ClientConnection) -> None:
    """Take every view, note it, acknowledge it."""
    while True:
        raw = await page.recv(decode=False)
        now_ns = time.monotonic_ns()
        if raw.startswith(VIEW):
            await page.send(ACKNOWLEDGE)
            sys.stdout.write(f"{number} {now_ns} {zlib.crc32(raw)}\n")


async def main() -> None:
    """Until we are ended."""
    address, origin, count, *rest = sys.argv[1:]
    cookie = sys.stdin.readline().strip()
    pages = [await open_page(address, origin, cookie) for _ in range(int(count))]
    if "--stall" in rest:
        pages.pop().transport.pause_reading()
    print("ready", flush=True)
    await asyncio.gather(flush(), *(look(number, page) for number, page in enumerate(pages)))


async def flush() -> None:
    """Hand on what was noted, in one go: writing must not be what is measured."""
    while True:
        await asyncio.sleep(0.2)
        sys.stdout.flush()


if __name__ == "__main__":
    asyncio.run(main())
