"""Fair turns for the work of unknown clients: who sends much waits longer, and nobody else does."""

from __future__ import annotations

import asyncio
from collections import OrderedDict, deque
from collections.abc import AsyncIterator, Callable, Hashable
from contextlib import asynccontextmanager
from typing import Any, Generic, NamedTuple, TypeVar

T = TypeVar("T")


class Owner(NamedTuple):
    """The client for whom work is done: a person who may stop robots (`proven`), else an address."""

    name: Hashable
    proven: bool = False


class FairQueue(Generic[T]):
    """Items that wait, by a key. Keys have turns in a circle; the items of one key keep their order."""

    def __init__(self) -> None:
        self._items: OrderedDict[Hashable, deque[T]] = OrderedDict()
        self._number = 0

    def __len__(self) -> int:
        return self._number

    def add(self, key: Hashable, item: T) -> None:
        """Add an item."""
        self._items.setdefault(key, deque()).append(item)
        self._number += 1

    def pop(self) -> T:
        """Remove and return the next item. Raises KeyError if none waits."""
        key, items = self._items.popitem(last=False)
        item = items.popleft()
        if items:
            self._items[key] = items
        self._number -= 1
        return item


class WorkQueue:
    """Bytes of clients are handled in pieces, one per turn of the loop: drive input waits for one piece.

    Pieces of people who may stop robots and pieces of all others alternate while both wait. `soon(work)` must call
    `work` in the next turn of the loop.
    """

    def __init__(self, soon: Callable[[Callable[[], None]], Any]) -> None:
        self._soon = soon
        self._proven: FairQueue[Callable[[], None]] = FairQueue()
        self._others: FairQueue[Callable[[], None]] = FairQueue()
        self._others_next = False
        self._scheduled = False

    def add(self, work: Callable[[], None], owner: Owner) -> None:
        """Run `work` in a separate turn of the loop."""
        (self._proven if owner.proven else self._others).add(owner.name, work)
        if not self._scheduled:
            self._scheduled = True
            self._soon(self._next)

    def _next(self) -> None:
        of_others = bool(self._others) and (self._others_next or not self._proven)
        self._others_next = not of_others
        work = (self._others if of_others else self._proven).pop()
        try:
            work()
        finally:
            self._scheduled = bool(self._proven or self._others)
            if self._scheduled:
                self._soon(self._next)


class Turns:
    """At most `at_once` pieces of work run at a time; the others wait in a fair queue."""

    def __init__(self, at_once: int) -> None:
        self._free = at_once
        self._waiting: FairQueue[Callable[[], bool]] = FairQueue()

    def ask(self, key: Hashable, begin: Callable[[], bool]) -> None:
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
    async def turn(self, key: Hashable) -> AsyncIterator[None]:
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
