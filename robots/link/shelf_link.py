"""A connection to the shelf beside a bridge, which reads files of recordings there; for code without an event loop."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, suppress
from uuid import UUID

from websockets.sync.client import ClientConnection

from robots.link.connections import open_sync
from robots.link.state_reader import Connection, refused_in_words
from robots.shared import wire
from robots.shared.configuration.bridge_config import LinkAddress
from robots.shared.wire import ShelfPart, ShelfRead

OPEN_S = 10.0  # the process starts in this time, also on a slow computer
READ_S = 8.0


class ShelfLink:
    """While it is open, the shelf runs. Raises LinkRefused if it cannot be opened."""

    def __init__(self, robot_id: UUID, address: LinkAddress) -> None:
        end_s = time.monotonic() + OPEN_S
        with refused_in_words(address), ExitStack() as stack:
            bridge = stack.enter_context(closing(Connection(robot_id, address, end_s)))
            self._socket = stack.enter_context(next(_opened(bridge, end_s)))
            self.close = stack.pop_all().close

    def read(self, asked: ShelfRead) -> tuple[ShelfPart, memoryview]:
        """Return what is asked. Raises ConnectionClosed, msgspec.DecodeError or, after `READ_S`, TimeoutError."""
        self._socket.send(wire.encode(asked), text=True)
        return wire.unshelved(self._socket.recv(timeout=READ_S, decode=False))


def _opened(bridge: Connection, end_s: float) -> Iterator[ClientConnection]:
    """Yield a connection for each address at which the process is: the bridge may not know yet that one died."""
    for address in bridge.addresses("shelf", end_s):
        with suppress(ConnectionError, FileNotFoundError):
            yield open_sync(address)
