"""Ends of tasks, as pages show them: the name of a person in their words is for the moment, not for hours.

All who see the robot see its last ends. A name is news for the holder, who wants to know who ended a task; later it
would tell strangers about the past (docs/audit.md, Names that others see).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Protocol

from msgspec import structs

from robots.shared.sentences import Sentence

NAMED_S = 60.0  # a name is shown for this time


class ShowsEnd(Protocol):
    """A part that shows how its last task ended."""

    last: Any  # a struct with `text`; None: no task has ended


class NamedEnds:
    """The words with names that ended tasks lately."""

    def __init__(self) -> None:
        # Words with a name: the same without it, and when they were first seen.
        self._plain: dict[str, tuple[Sentence, float | None]] = {}

    def words(self, named: str, plain: Sentence) -> str:
        """Return the words that name a person; later, pages have the `plain` ones."""
        self._plain[named] = plain, None
        return named

    def tick(self, parts: Iterable[ShowsEnd], now_s: float) -> None:
        """Take the names out of ends that are no news any more."""
        if not self._plain:
            return
        old: dict[str, Sentence] = {}
        for named, (plain, since_s) in list(self._plain.items()):
            if since_s is None:
                self._plain[named] = plain, now_s
            elif now_s - since_s > NAMED_S:
                old[named] = plain
                del self._plain[named]
        for part in parts:
            if part.last is not None and part.last.text in old:
                part.last = structs.replace(part.last, text=old[part.last.text])
