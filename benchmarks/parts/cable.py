"""A cable between two sockets of this machine that can be slow, lossy, frozen or cut."""

from __future__ import annotations

import asyncio
import random
import socket
import time
from contextlib import suppress
from dataclasses import dataclass

SEGMENT_BYTES = 1400
# In each direction: buffer of a radio network; when the buffer is full, the sender waits
QUEUED_SEGMENTS = 32
RETRANSMISSION_S = 0.2  # TCP's shortest time-out
SOCKET_BUFFER_BYTES = 16 * 1024

Address = str | tuple[str, int]  # path of a Unix socket, or host and port


@dataclass(frozen=True)
class Profile:
    """A network: bandwidth in each direction, round trip, and the share of segments that are lost."""

    name: str
    kbit_s: float
    round_trip_ms: float
    loss: float = 0.0


class Connection:
    """One connection through the cable."""

    def __init__(self, cable: Cable) -> None:
        self._cable = cable
        self.writers: list[asyncio.StreamWriter] = []

    async def carry(self, ends: list[tuple[asyncio.StreamReader, asyncio.StreamWriter]]) -> None:
        """Carry bytes until one side closes."""
        (here_reads, here_writes), (there_reads, there_writes) = ends
        self.writers = [here_writes, there_writes]
        pumps = [
            asyncio.create_task(self._pump(here_reads, there_writes)),
            asyncio.create_task(self._pump(there_reads, here_writes)),
        ]
        try:
            await asyncio.wait(pumps, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for pump in pumps:
                pump.cancel()
            self.close()

    def close(self) -> None:
        """Close both ends, so that both sides notice."""
        for writer in self.writers:
            writer.transport.abort()

    async def _pump(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        on_its_way: asyncio.Queue[tuple[float, bytes]] = asyncio.Queue(QUEUED_SEGMENTS)
        delivering = asyncio.create_task(self._deliver(on_its_way, writer))
        free_s = arrives_s = 0.0
        try:
            with suppress(ConnectionError):
                while segment := await reader.read(SEGMENT_BYTES):
                    free_s = max(free_s, time.monotonic()) + self._cable.transmission_s(len(segment))
                    arrives_s = max(arrives_s, free_s + self._cable.way_s())  # TCP delivers in order
                    await on_its_way.put((arrives_s, segment))
        finally:
            delivering.cancel()

    async def _deliver(
        self, segments: asyncio.Queue[tuple[float, bytes]], writer: asyncio.StreamWriter
    ) -> None:
        with suppress(ConnectionError):
            while True:
                arrives_s, segment = await segments.get()
                await asyncio.sleep(max(0.0, arrives_s - time.monotonic()))
                await self._cable.thawed.wait()
                writer.write(segment)
                await writer.drain()


class Cable:
    """Async context: listens at `here` and connects each caller to `there`."""

    def __init__(self, here: Address, there: Address, profile: Profile | None = None) -> None:
        self._here = here
        self._there = there
        self.profile = profile
        self.connections: set[Connection] = set()
        self.thawed = asyncio.Event()
        self.thawed.set()
        self._random = random.Random(1)  # noqa: S311 - which segments are lost

    async def __aenter__(self) -> Cable:
        if isinstance(self._here, str):
            self._server = await asyncio.start_unix_server(self._serve, self._here)
        else:
            self._server = await asyncio.start_server(self._serve, *self._here)
        return self

    async def __aexit__(self, *_: object) -> None:
        self._server.close()
        self.thawed.set()
        self.cut()
        await asyncio.sleep(0)

    @property
    def port(self) -> int:
        """Return the port on which the cable listens."""
        number: int = self._server.sockets[0].getsockname()[1]
        return number

    def cut(self) -> None:
        """Close every connection; new connections are accepted."""
        for connection in list(self.connections):
            connection.close()

    def freeze(self) -> None:
        """Deliver no more bytes; neither side notices."""
        self.thawed.clear()

    def thaw(self) -> None:
        """Deliver all waiting bytes at once."""
        self.thawed.set()

    def transmission_s(self, count: int) -> float:
        """Return for how many seconds `count` bytes occupy the cable."""
        return count * 8 / (self.profile.kbit_s * 1000.0) if self.profile else 0.0

    def way_s(self) -> float:
        """Return a segment's travel time in seconds. A lost segment waits for its repetition."""
        if self.profile is None:
            return 0.0
        way_s = self.profile.round_trip_ms / 2000.0
        if self._random.random() < self.profile.loss:
            way_s += max(RETRANSMISSION_S, 2 * way_s) + 2 * way_s
        return way_s

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        connection = Connection(self)
        self.connections.add(connection)
        try:
            if isinstance(self._there, str):
                far = await asyncio.open_unix_connection(self._there)
            else:
                far = await asyncio.open_connection(*self._there)
            for end in (writer, far[1]):
                _tune(end.get_extra_info("socket"))
            await connection.carry([(reader, writer), far])
        except OSError:
            writer.transport.abort()
        finally:
            self.connections.discard(connection)


def _tune(end: socket.socket) -> None:
    """Set small buffers, so that only the cable delays bytes."""
    if end.family == socket.AF_UNIX:
        return
    end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    for option in (socket.SO_SNDBUF, socket.SO_RCVBUF):
        end.setsockopt(socket.SOL_SOCKET, option, SOCKET_BUFFER_BYTES)
