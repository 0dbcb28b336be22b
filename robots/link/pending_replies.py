"""Requests over a link that have no answer yet."""

from __future__ import annotations

import asyncio
from collections import defaultdict, deque
from collections.abc import Hashable, Iterator
from contextlib import contextmanager
from itertools import count
from typing import Generic, TypeVar

A = TypeVar("A")


class PendingReplies(Generic[A]):
    """Pending requests of one kind, by the key of the answer. The oldest request with a key is answered first."""

    def __init__(self) -> None:
        self._waiting: dict[Hashable, deque[asyncio.Future[A]]] = defaultdict(deque)
        self._numbers = count(1)

    def __len__(self) -> int:
        return sum(map(len, self._waiting.values()))

    def number(self) -> int:
        """Return a number that no other request of this kind has."""
        return next(self._numbers)

    @contextmanager
    def waiting_for(self, key: Hashable) -> Iterator[asyncio.Future[A]]:
        """Context: a future for the answer. It is registered only inside the `with` block."""
        answer: asyncio.Future[A] = asyncio.get_running_loop().create_future()
        self._waiting[key].append(answer)
        try:
            yield answer
        finally:
            if not answer.cancel() and not answer.cancelled():
                answer.exception()  # mark it as retrieved: the caller may have stopped waiting
            self._waiting[key].remove(answer)
            if not self._waiting[key]:
                del self._waiting[key]

    def answer(self, key: Hashable, answer: A | Exception) -> None:
        """Give the answer to the waiting caller, unless the caller has stopped waiting."""
        first = next((waiting for waiting in self._waiting.get(key, ()) if not waiting.done()), None)
        if first is not None:
            _set_result(first, answer)

    def answer_all(self, error: Exception) -> None:
        """End all waits with this error."""
        for waiting in [future for futures in self._waiting.values() for future in futures]:
            if not waiting.done():
                _set_result(waiting, error)


def _set_result(waiting: asyncio.Future[A], answer: A | Exception) -> None:
    if isinstance(answer, Exception):
        waiting.set_exception(answer)
    else:
        waiting.set_result(answer)
