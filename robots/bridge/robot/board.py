"""Records for the page why data of a robot's network was dropped; and publishers that are cut off."""

from __future__ import annotations

import logging
import threading
import time
from collections import OrderedDict

from robots.shared.texts import SENTENCE, cut

log = logging.getLogger(__name__)

SHOWN_S = 15.0  # longer than a publisher is cut off, so that a repeated fault is shown without gaps
MOST_SHOWN = 20
MOST_BARRED = 500  # publishers


class Board:
    """The record of one process. Thread-safe. A full record drops its oldest entries."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._shown: OrderedDict[str, tuple[str, float]] = OrderedDict()  # by subject: text, end (s)
        self._barred: OrderedDict[tuple[str, str], float] = OrderedDict()  # topic and address: end (s)
        self._dropped: dict[str, float] = {}  # by topic: end (s) of an entry dropped from `_barred`

    def complain(self, subject: str, words: str, now_s: float | None = None) -> None:
        """Show a complaint about `subject` for `SHOWN_S`. A new complaint is logged."""
        now_s = time.monotonic() if now_s is None else now_s
        words = cut(words, SENTENCE)
        with self._lock:
            is_new = subject not in self._alive(now_s)
            self._shown[subject] = words, now_s + SHOWN_S
            self._shown.move_to_end(subject)
            while len(self._shown) > MOST_SHOWN:
                self._shown.popitem(last=False)
        if is_new:
            log.warning("%s", words)

    def texts(self, now_s: float | None = None) -> list[str]:
        """Return the present entries, newest first."""
        with self._lock:
            alive = self._alive(time.monotonic() if now_s is None else now_s)
            return [words for words, _ in reversed(alive.values())]

    def text(self, subject: str) -> str:
        """Return the entry of one subject; empty if there is none."""
        with self._lock:
            return self._alive(time.monotonic()).get(subject, ("", 0.0))[0]

    def bar(self, topic: str, uri: str, until_s: float) -> None:
        """Do not listen to this publisher before `until_s`."""
        with self._lock:
            self._barred[topic, uri] = until_s
            self._barred.move_to_end((topic, uri))
            while len(self._barred) > MOST_BARRED:
                (oldest, _), end_s = self._barred.popitem(last=False)
                self._dropped.setdefault(oldest, end_s)

    def barred(self, topic: str, uri: str, now_s: float | None = None) -> bool:
        """Return whether this publisher is still barred."""
        now_s = time.monotonic() if now_s is None else now_s
        with self._lock:
            return self._barred.get((topic, uri), 0.0) > now_s

    def released(self, now_s: float) -> set[str]:
        """Return the topics of publishers that are no longer barred; each is returned once."""
        with self._lock:
            over = [key for key, until_s in self._barred.items() if until_s <= now_s]
            for key in over:
                del self._barred[key]
            dropped = {topic for topic, until_s in self._dropped.items() if until_s <= now_s}
            for topic in dropped:
                del self._dropped[topic]
        return {topic for topic, _ in over} | dropped

    def _alive(self, now_s: float) -> OrderedDict[str, tuple[str, float]]:
        for subject in [subject for subject, (_, until_s) in self._shown.items() if until_s <= now_s]:
            del self._shown[subject]
        return self._shown


BOARD = Board()  # one per process, as its node
