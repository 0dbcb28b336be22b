"""Count connections, requests and WebSockets: all together, and from each address.

If there is no place, a new connection takes the place of the oldest waiting one: so an unknown client that
keeps many connections open cannot lock others out.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from fleet.server import limits

K = TypeVar("K", bound=Hashable)


@dataclass
class Connections(Generic[K]):
    """Open connections, by a key of the caller's choice.

    `address` is None if one address stands for many people: behind a proxy, or on a Unix socket.
    """

    most: int = limits.CONNECTIONS
    most_of_address: int = limits.CONNECTIONS_OF_ADDRESS
    _open: dict[K, str | None] = field(default_factory=dict)
    _waiting: dict[K, None] = field(default_factory=dict)  # oldest first; no complete request since then
    _of_address: Counter[str] = field(default_factory=Counter)

    def admit(self, key: K, address: str | None) -> tuple[bool, K | None]:
        """Return whether this connection is admitted, and which waiting connection must close for it."""
        leaves = None
        if address is not None and self._of_address[address] >= self.most_of_address:
            leaves = next((waiting for waiting in self._waiting if self._open[waiting] == address), None)
            if leaves is None:
                return False, None
        elif len(self._open) >= self.most:
            leaves = next(iter(self._waiting), None)
            if leaves is None:
                return False, None
        if leaves is not None:
            self.left(leaves)
        self._open[key] = address
        self._waiting[key] = None
        if address is not None:
            self._of_address[address] += 1
        return True, leaves

    def working(self, key: K) -> None:
        """Note that a connection's request is being answered, or that it is a WebSocket.

        It keeps its place.
        """
        self._waiting.pop(key, None)

    def waiting(self, key: K) -> None:
        """Note that a connection waits for a request again."""
        if key in self._open:
            self._waiting[key] = None

    def left(self, key: K) -> None:
        """Note that a connection is closed. May be called more than once."""
        self._waiting.pop(key, None)
        address = self._open.pop(key, None)
        if address is not None:
            self._of_address[address] -= 1
            if not self._of_address[address]:
                del self._of_address[address]

    def __len__(self) -> int:
        return len(self._open)


@dataclass
class Places:
    """Places that are taken and given back, counted together and for each address."""

    most: int
    most_of_address: int
    taken: int = 0
    _of_address: Counter[str] = field(default_factory=Counter)

    def take(self, address: str, number: int = 1) -> bool:
        """Take places. Return False if there are not so many."""
        if self.taken + number > self.most or self._of_address[address] + number > self.most_of_address:
            return False
        self.taken += number
        self._of_address[address] += number
        return True

    def give_back(self, address: str, number: int = 1) -> None:
        """Give back places that were taken."""
        self.taken -= number
        self._of_address[address] -= number
        if not self._of_address[address]:
            del self._of_address[address]
