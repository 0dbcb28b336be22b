"""Refusals on record: what a person asked for and was not done, by whatever door, with the figures behind it.

A thread of its own writes them, so that no answer waits for the database. One person's refusals with one code at one
robot are folded: the first is written at once, what follows within `GAP_S` in one record with the number of `times`.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple
from uuid import UUID

from django.db import DatabaseError, close_old_connections

from fleet import audit
from fleet.accounts.models import User
from robots.wire import Refusal

logger = logging.getLogger(__name__)

GAP_S = 10.0
PACING_GAP_S = 600.0
PACING = frozenset({"too_old", "out_of_order", "flood", "busy"})  # not what was asked for, but when
MOST = 500  # folds at once; what is refused beyond is only logged

Key = tuple[UUID, UUID | None, UUID | None, str]


class Denied(NamedTuple):
    """Something that somebody asked for and did not get."""

    person: User
    through: str  # which door
    of: str  # the kind of message, or of request
    refusal: Refusal
    robot_id: UUID | None = None
    robot_name: str = ""
    session_id: UUID | None = None  # the person's control session there, if they have control
    fence: int | None = None

    @property
    def key(self) -> Key:
        """What is folded into one."""
        return self.person.pk, self.robot_id, self.session_id, self.refusal.code


def put_on_record(denied: Denied, times: int) -> None:
    """Write one record of what was refused so many times. That it is lost is no error to the person: it is logged.

    Figures that are words may name persons, or repeat what somebody typed: they may expire, numbers stay.
    """
    refusal = denied.refusal
    numbers = {name: value for name, value in refusal.figures.items() if not isinstance(value, str)}
    facts: dict[str, Any] = {"rule": refusal.rule, "of": denied.of, "through": denied.through}
    if numbers:
        facts["figures"] = numbers
    if times > 1:
        facts["times"] = times
    whole = {"figures": refusal.figures} if numbers != refusal.figures else {}
    try:
        close_old_connections()
        audit.record(
            "refusal",
            actor=denied.person,
            robot_id=denied.robot_id,
            robot_name=denied.robot_name,
            session_id=denied.session_id,
            fence=denied.fence,
            outcome=refusal.code,
            parameters=facts,
            private={"words": refusal.text, **whole},
        )
    except (audit.AuditUnavailable, DatabaseError) as error:
        who = denied.person.pk
        logger.error("%d refusals (%s) of %s were not recorded: %s", times, refusal.code, who, error)
    finally:
        close_old_connections()


@dataclass
class _Fold:
    """Refusals with one key; `due_s` is when they are written, or forgotten if there were no more."""

    newest: Denied
    times: int
    due_s: float


class RefusalLog:
    """Folds refusals, and writes them in a thread that is there only while there is something to write."""

    def __init__(self, write: Callable[[Denied, int], None] = put_on_record) -> None:
        self._write = write
        self._changed = threading.Condition()
        self._folds: dict[Key, _Fold] = {}
        self._thread: threading.Thread | None = None

    def note(self, denied: Denied) -> None:
        """Put a refusal on record, some time soon. From any thread; never waits for the database."""
        with self._changed:
            fold = self._folds.get(denied.key)
            if fold is not None:
                fold.newest, fold.times = denied, fold.times + 1
            elif len(self._folds) >= MOST:
                logger.error("too many refusals to record: %s of %s is lost", denied.refusal.code, denied.of)
            else:
                self._folds[denied.key] = _Fold(denied, 1, time.monotonic())
                self._see_to_the_thread()
                self._changed.notify()

    def end(self) -> None:
        """Forget what is not written yet; what is being written is waited for."""
        with self._changed:
            self._folds.clear()
            self._changed.notify()
            thread = self._thread
        if thread is not None:
            thread.join()

    def _see_to_the_thread(self) -> None:
        if self._thread is None:
            self._thread = threading.Thread(target=self._keep_writing, name="refusals", daemon=True)
            self._thread.start()

    def _keep_writing(self) -> None:
        while (due := self._next()) is not None:
            try:
                self._write(*due)
            except Exception:
                logger.exception("a refusal was not recorded")

    def _next(self) -> tuple[Denied, int] | None:
        """What is to be written, once it is due; None when nothing is left to wait for."""
        with self._changed:
            while self._folds:
                fold = min(self._folds.values(), key=lambda fold: fold.due_s)
                now_s = time.monotonic()
                if now_s < fold.due_s:
                    self._changed.wait(fold.due_s - now_s)
                elif fold.times == 0:
                    del self._folds[fold.newest.key]
                else:
                    times, fold.times = fold.times, 0
                    fold.due_s = now_s + (PACING_GAP_S if fold.newest.refusal.code in PACING else GAP_S)
                    return fold.newest, times
            self._thread = None
            return None


log = RefusalLog()


def note(denied: Denied) -> None:
    """Put a refusal on record, some time soon."""
    log.note(denied)
