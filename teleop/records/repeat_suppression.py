"""Few records for repeated events: the first event is recorded at once, repeats within some seconds share one record.

Each person also has a record budget (`RECORDS_PER_S`, `RECORDS_BURST`) in each `RepeatSuppressor`, for all
interfaces and codes together. Camera viewings have two more budgets (`camera_audit`). If the budget is used
up, records wait, and repeats are still counted. So no person can make the log grow faster, and no event is
lost within the limit `MOST`.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from robots.shared.link.flood_limits import TokenBucket

logger = logging.getLogger(__name__)

MOST = 500  # keys that wait at once, if people can choose the keys; events of more keys are only logged
MOST_PER_PERSON = 100  # of these keys, so that one person does not use up the places of others
RECORDS_PER_S = 0.2  # per person and web process
RECORDS_BURST = 30.0
_SPARED = 1000  # number of keys to remember whose first record used no budget


class Event(Protocol):
    """An event to record."""

    @property
    def key(self) -> Hashable:
        """Events with the same key are repeats."""

    @property
    def gap_s(self) -> float:
        """Seconds between two records of repeats."""

    @property
    def person(self) -> Any:
        """The account whose budget the record uses."""

    @property
    def deferrable(self) -> bool:
        """Return whether its first record also waits for the budget."""


class RecordBudgets:
    """Each person's record budget."""

    def __init__(self) -> None:
        self._budgets: dict[Hashable, TokenBucket] = {}

    def wait_s(self, person: Hashable, now_s: float) -> float:
        """Use one record of this person's budget. Returns 0.0, or the seconds until there is budget again."""
        budget = self._budgets.get(person)
        if budget is None:
            self._forget(now_s)
            budget = self._budgets[person] = TokenBucket(RECORDS_PER_S, RECORDS_BURST)
        return 0.0 if budget.spend(now_s) else budget.wait_s(now_s)

    def _forget(self, now_s: float) -> None:
        for person in [person for person, budget in self._budgets.items() if budget.is_full(now_s)]:
            del self._budgets[person]


E = TypeVar("E", bound=Event)


@dataclass
class _Repeats(Generic[E]):
    """Events with one key. At `due_s` they are written, or dropped if no repeat arrived."""

    newest: E
    times: int
    due_s: float


class RepeatSuppressor(Generic[E]):
    """Collects repeated events and writes them in a thread that runs only while there is something to write."""

    def __init__(self, write: Callable[[E, int], None], *, most: int | None = MOST) -> None:
        self._write = write
        self._most = most
        self._at_once = False
        self._ration = RecordBudgets()
        self._spared: OrderedDict[Hashable, None] = OrderedDict()
        self._changed = threading.Condition()
        self._waiting: dict[Hashable, _Repeats[E]] = {}
        self._thread: threading.Thread | None = None

    def add(self, event: E) -> None:
        """Record an event soon. Callable from any thread; never waits for the database."""
        with self._changed:
            repeats = self._waiting.get(event.key)
            if repeats is not None:
                repeats.newest, repeats.times = event, repeats.times + 1
            elif not self._has_capacity(event.person.pk):
                logger.error("Too many events to record: %s is lost.", event.key)
            else:
                self._waiting[event.key] = _Repeats(event, 1, time.monotonic())
                self._start_thread()
                self._changed.notify()

    def _has_capacity(self, person: Hashable) -> bool:
        if self._most is None:
            return True
        of_person = sum(repeats.newest.person.pk == person for repeats in self._waiting.values())
        return len(self._waiting) < self._most and of_person < MOST_PER_PERSON

    def flush(self) -> None:
        """Write all waiting events now: for the end of the process."""
        with self._changed:
            thread, self._at_once = self._thread, True
            self._changed.notify()
        if thread is not None:
            thread.join()
        self._at_once = False

    def _start_thread(self) -> None:
        if self._thread is None:
            self._thread = threading.Thread(target=self._keep_writing, name="repeats", daemon=True)
            self._thread.start()

    def _keep_writing(self) -> None:
        while (due := self._next()) is not None:
            try:
                self._write(*due)
            except Exception:
                logger.exception("An event that happened %d times was not recorded.", due[1])

    def _next(self) -> tuple[E, int] | None:
        """Wait for the next due event; return it and how many times it happened. None: no event is waiting."""
        with self._changed:
            while self._waiting:
                repeats = min(self._waiting.values(), key=lambda repeats: repeats.due_s)
                now_s = time.monotonic()
                if repeats.times == 0 and self._at_once:
                    del self._waiting[repeats.newest.key]
                elif now_s < repeats.due_s and not self._at_once:
                    self._changed.wait(repeats.due_s - now_s)
                elif repeats.times == 0:
                    del self._waiting[repeats.newest.key]
                elif not self._at_once and (wait_s := self._wait_s(repeats.newest, now_s)) > 0.0:
                    repeats.due_s = now_s + wait_s
                else:
                    times, repeats.times = repeats.times, 0
                    repeats.due_s = now_s + repeats.newest.gap_s
                    return repeats.newest, times
            self._thread = None
            return None

    def _wait_s(self, event: E, now_s: float) -> float:
        """Return for how many seconds the event's record must wait for the person's budget."""
        if not event.deferrable and event.key not in self._spared:
            self._spared[event.key] = None
            if len(self._spared) > _SPARED:
                self._spared.popitem(last=False)
            return 0.0
        return self._ration.wait_s(event.person.pk, now_s)
