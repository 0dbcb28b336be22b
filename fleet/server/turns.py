"""Fair turns for the work of unknown clients: who sends much waits longer, and nobody else does."""

from __future__ import annotations

import asyncio
from collections import OrderedDict, deque
from collections.abc import AsyncIterator, Callable, Hashable
from contextlib import asynccontextmanager
from typing import Any, Generic, TypeVar

T = TypeVar("T")


Key = tuple[Hashable, ...]


class FairQueue(Generic[T]):
    """Items that wait, each by a key of several parts, such as person and session.

    Each first part has its turn in a circle, inside it each second part, and so on. Items of one key keep their order.
    """

    def __init__(self) -> None:
        self._items: deque[T] = deque()  # of the key without parts
        self._parts: OrderedDict[Hashable, FairQueue[T]] = OrderedDict()
        self._number = 0

    def __len__(self) -> int:
        return self._number

    def add(self, key: Key, item: T) -> None:
        self._number += 1
        if key:
            self._parts.setdefault(key[0], FairQueue()).add(key[1:], item)
        else:
            self._items.append(item)

    def pop(self) -> T:
        """Remove and return the next item. There must be one."""
        self._number -= 1
        if self._items:
            return self._items.popleft()
        first, rest = self._parts.popitem(last=False)
        item = rest.pop()
        if rest:
            self._parts[first] = rest
        return item


class WorkQueue:
    """Bytes of clients are handled in pieces, one per turn of the loop: drive input waits for one piece.

    `soon(work)` must call `work` in the next turn of the loop.
    """

    def __init__(self, soon: Callable[[Callable[[], None]], Any]) -> None:
        self._soon = soon
        self._waiting: FairQueue[Callable[[], None]] = FairQueue()
        self._scheduled = False

    def add(self, work: Callable[[], None], owner: Key) -> None:
        """Run `work` in a separate turn of the loop, in the fair turn of its owner."""
        self._waiting.add(owner, work)
        if not self._scheduled:
            self._scheduled = True
            self._soon(self._next)

    async def turn(self, owner: Key) -> None:
        """Wait for the fair turn of this owner."""
        begun: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self.add(lambda: None if begun.done() else begun.set_result(None), owner)
        await begun

    def _next(self) -> None:
        work = self._waiting.pop()
        try:
            work()
        finally:
            self._scheduled = bool(self._waiting)
            if self._scheduled:
                self._soon(self._next)


class Turns:
    """At most `at_once` pieces of work run at a time; the others wait in a fair queue."""

    def __init__(self, at_once: int) -> None:
        self._free = at_once
        self._waiting: FairQueue[Callable[[], bool]] = FairQueue()

    def ask(self, key: Key, begin: Callable[[], bool]) -> None:
        """Call `begin` when it is the turn of `key`, perhaps now.

        It returns False if nothing is to be done any more; else `over` must be called at the end of the work.
        """
        if not self._free:
            self._waiting.add(key, begin)
        elif begin():
            self._free -= 1

    def over(self) -> None:
        """Begin the next work, because one piece of work has ended."""
        while self._waiting:
            if self._waiting.pop()():
                return
        self._free += 1

    @asynccontextmanager
    async def turn(self, key: Key) -> AsyncIterator[None]:
        """Context: wait for the turn of `key`, and hold it."""
        begun: asyncio.Future[None] = asyncio.get_running_loop().create_future()

        def begin() -> bool:
            if begun.done():  # cancelled
                return False
            begun.set_result(None)
            return True

        self.ask(key, begin)
        try:
            await begun
            yield
        finally:
            if not begun.cancelled():
                self.over()
