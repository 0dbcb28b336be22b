"""What happens again and again, on record in few records: the first at once, what follows within a while in one.

One person's records of this kind have a budget besides (`RECORDS_PER_S`, `RECORDS_BURST`), by whatever doors and of
whatever codes: without it they wait, and count on. So nobody makes the log grow faster, and nothing is lost.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from robots.bridge.server.flood_limits import Budget

logger = logging.getLogger(__name__)

MOST = 500  # folds at once of what anybody chooses the keys of; what happens beyond is only logged
MOST_OF_PERSON = 100  # of these: who waits for the own budget must not take the places of others
RECORDS_PER_S = 0.2  # of one person, from one web process
RECORDS_BURST = 30.0
_SPARED = 1000  # keys that are remembered to have been written without a budget


class Event(Protocol):
    """Something that is to go on record."""

    @property
    def key(self) -> Hashable:
        """What is folded into one."""

    @property
    def gap_s(self) -> float:
        """Between two records of it."""

    @property
    def person(self) -> Any:
        """Whose budget it takes: an account."""

    @property
    def waits(self) -> bool:
        """Whether its first record waits for the budget, too."""


class RecordBudgets:
    """Each person's budget of records."""

    def __init__(self) -> None:
        self._budgets: dict[Hashable, Budget] = {}

    def wait_s(self, person: Hashable, now_s: float) -> float:
        """Take one record of this person's; if there is none, how long until there is."""
        budget = self._budgets.get(person)
        if budget is None:
            self._forget(now_s)
            budget = self._budgets[person] = Budget(RECORDS_PER_S, RECORDS_BURST)
        return 0.0 if budget.spend(now_s) else budget.wait_s(now_s)

    def _forget(self, now_s: float) -> None:
        for person in [person for person, budget in self._budgets.items() if budget.is_full(now_s)]:
            del self._budgets[person]


E = TypeVar("E", bound=Event)


@dataclass
class _Fold(Generic[E]):
    """Events with one key; `due_s` is when they are written, or forgotten if there were no more."""

    newest: E
    times: int
    due_s: float


class RepeatSuppressor(Generic[E]):
    """Folds events, and writes them in a thread that is there only while there is something to write."""

    def __init__(self, write: Callable[[E, int], None], *, most: int | None = MOST) -> None:
        self._write = write
        self._most = most
        self._at_once = False
        self._ration = RecordBudgets()
        self._spared: OrderedDict[Hashable, None] = OrderedDict()
        self._changed = threading.Condition()
        self._folds: dict[Hashable, _Fold[E]] = {}
        self._thread: threading.Thread | None = None

    def note(self, event: E) -> None:
        """Put an event on record, some time soon. From any thread; never waits for the database."""
        with self._changed:
            fold = self._folds.get(event.key)
            if fold is not None:
                fold.newest, fold.times = event, fold.times + 1
            elif not self._has_room(event.person.pk):
                logger.error("too much to record: %s is lost", event.key)
            else:
                self._folds[event.key] = _Fold(event, 1, time.monotonic())
                self._see_to_the_thread()
                self._changed.notify()

    def _has_room(self, person: Hashable) -> bool:
        if self._most is None:
            return True
        of_person = sum(fold.newest.person.pk == person for fold in self._folds.values())
        return len(self._folds) < self._most and of_person < MOST_OF_PERSON

    def flush(self) -> None:
        """Write at once what waits, and be done with it: for the end of the process."""
        with self._changed:
            thread, self._at_once = self._thread, True
            self._changed.notify()
        if thread is not None:
            thread.join()
        self._at_once = False

    def _see_to_the_thread(self) -> None:
        if self._thread is None:
            self._thread = threading.Thread(target=self._keep_writing, name="folding", daemon=True)
            self._thread.start()

    def _keep_writing(self) -> None:
        while (due := self._next()) is not None:
            try:
                self._write(*due)
            except Exception:
                logger.exception("what happened %d times was not recorded", due[1])

    def _next(self) -> tuple[E, int] | None:
        """What is to be written, once it is due; None when nothing is left to wait for."""
        with self._changed:
            while self._folds:
                fold = min(self._folds.values(), key=lambda fold: fold.due_s)
                now_s = time.monotonic()
                if fold.times == 0 and self._at_once:
                    del self._folds[fold.newest.key]
                elif now_s < fold.due_s and not self._at_once:
                    self._changed.wait(fold.due_s - now_s)
                elif fold.times == 0:
                    del self._folds[fold.newest.key]
                elif not self._at_once and (wait_s := self._wait_s(fold.newest, now_s)) > 0.0:
                    fold.due_s = now_s + wait_s
                else:
                    times, fold.times = fold.times, 0
                    fold.due_s = now_s + fold.newest.gap_s
                    return fold.newest, times
            self._thread = None
            return None

    def _wait_s(self, event: E, now_s: float) -> float:
        """How long its record has to wait for the person's budget."""
        if not event.waits and event.key not in self._spared:
            self._spared[event.key] = None
            if len(self._spared) > _SPARED:
                self._spared.popitem(last=False)
            return 0.0
        return self._ration.wait_s(event.person.pk, now_s)
