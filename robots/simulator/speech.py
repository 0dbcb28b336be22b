"""Speech as on PAL's robots, without ROS: a language is mandatory, and each spoken word is reported."""

from __future__ import annotations

import re
from enum import IntEnum
from typing import NamedTuple

_LANGUAGE = re.compile(r"[a-z]{2}_[A-Z]{2}")
_WORD_S = 0.12
_LETTER_S = 0.06


class Event(IntEnum):
    """The bits of TtsFeedback.event_type that are used here."""

    STARTED_WORD = 32
    FINISHED_UTTERANCE = 8


class Mark(NamedTuple):
    """Feedback: the word that begins, or the end."""

    event: Event
    said: str
    next_word: str


class Utterance:
    """One text being spoken. Times are seconds of one clock."""

    def __init__(self, text: str, wait_s: float, now: float) -> None:
        self._words = text.split()
        self._starts: list[float] = []
        moment = now + max(wait_s, 0.0)
        for word in self._words:
            self._starts.append(moment)
            moment += _WORD_S + _LETTER_S * len(word)
        self.ends_at = moment
        self._announced = 0
        self._finished = False

    def marks(self, now: float) -> list[Mark]:
        """Return the events since the last call."""
        new = []
        while self._announced < len(self._words) and self._starts[self._announced] <= now:
            self._announced += 1
            new.append(Mark(Event.STARTED_WORD, " ".join(self._words[: self._announced]), self._next_word()))
        if not self._finished and self.is_over(now):
            self._finished = True
            new.append(Mark(Event.FINISHED_UTTERANCE, " ".join(self._words), ""))
        return new

    def is_over(self, now: float) -> bool:
        """Return whether the last word was spoken."""
        return now >= self.ends_at

    def _next_word(self) -> str:
        return self._words[self._announced] if self._announced < len(self._words) else ""


def objection(text: str, lang_id: str) -> str | None:
    """Return why the robot refuses to say this; None if it accepts."""
    if not text.strip():
        return "nothing to say: rawtext.text is empty"
    if not _LANGUAGE.fullmatch(lang_id):
        return f"rawtext.lang_id must name a language such as en_GB, not {lang_id!r}"
    return None
