"""A page that watches a robot's cameras."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from typing import Any

from websockets.asyncio.client import ClientConnection
from websockets.exceptions import ConnectionClosed

from script.stack.client import open_socket
from script.stack.stack import PRACTICE_ROBOTS, Stack
from tests.processes import PATIENCE_S


class Viewer:
    """A page that watches cameras and acknowledges their pictures, unless it `stalls`."""

    def __init__(self, socket: ClientConnection, *, stalls: bool) -> None:
        self.pictures: list[dict[str, Any]] = []
        self.refusals: dict[str, dict[str, Any] | None] = {}
        self.warnings: dict[str, dict[str, Any] | None] = {}
        self.closed_s: float | None = None
        self._socket = socket
        self._stalls = stalls
        self._news = asyncio.Condition()
        self._reader = asyncio.create_task(self._read())

    async def watch(self, *cameras: str) -> None:
        for camera in cameras:
            await self._send({"t": "camera_watch", "camera": camera})

    async def until(self, condition: Any) -> None:
        async with self._news:
            await asyncio.wait_for(self._news.wait_for(condition), 2 * PATIENCE_S)

    async def gets_pictures(self, camera: str = "head", count: int = 5) -> None:
        """Wait for `count` new pictures."""
        self.pictures.clear()
        await self.until(lambda: sum(one["camera"] == camera for one in self.pictures) >= count)

    async def close(self) -> None:
        await self._socket.close()
        await self._reader

    async def _send(self, message: dict[str, Any]) -> None:
        await self._socket.send(json.dumps(message))

    async def _read(self) -> None:
        with suppress(ConnectionClosed):
            while True:
                received = await self._socket.recv()
                async with self._news:
                    await self._take(received)
                    self._news.notify_all()
        async with self._news:
            self.closed_s = time.monotonic()
            self._news.notify_all()

    async def _take(self, received: str | bytes) -> None:
        if isinstance(received, bytes):
            header = json.loads(received[4 : 4 + int.from_bytes(received[:4], "big")])
            self.pictures.append(header)
            if not self._stalls:
                acknowledged = {"t": "camera_ack", "camera": header["camera"], "number": header["number"]}
                await self._send(acknowledged)
        elif (message := json.loads(received))["t"] == "camera_state":
            self.refusals[message["camera"]] = message["refusal"]
            self.warnings[message["camera"]] = message["warning"]


@asynccontextmanager
async def viewer(
    stack: Stack,
    cookie: str,
    *,
    robot: str = PRACTICE_ROBOTS[0].slug,
    stalls: bool = False,
    port: int | None = None,
) -> AsyncIterator[Viewer]:
    """Context: a page that watches cameras of this robot."""
    async with open_socket(stack, f"/ws/robots/{robot}/camera/", cookie, port) as socket:
        watching = Viewer(socket, stalls=stalls)
        yield watching
        await watching.close()
