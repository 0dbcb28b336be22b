"""Record changes of the robot's health, a limited number for any robot. Pure: time is an argument.

For each part the log keeps the level of its last record. A change is recorded at once while there is budget.
A part that changes too often waits, and one record with `times` stands for its changes. Silence while the
robot is away is not recorded: the absence is a fault of its own, and most parts are unchanged when the robot
is back. Other reports are still recorded for `SETTLED_S` after the robot went away: one of them may contain
the reason.
"""

from __future__ import annotations

import math
from concurrent.futures import Future
from dataclasses import dataclass, field

from robots.bridge.audit.records import Records
from robots.bridge.health.diagnostics import BADNESS, MOST_PARTS, Diagnostics, Part, plain_names
from robots.shared.link.flood_limits import TokenBucket
from robots.shared.sentences import say
from robots.shared.wire import HealthLevel

CHECK_S = 1.0
SETTLED_S = 60.0  # after the robot came (nodes may report later than odometry), and after it went away
PART_BURST, PART_GAP_S = 4, 600.0  # records of one part at once, and then one in this time
ROBOT_BURST, ROBOT_GAP_S = 30, 60.0  # the same for all parts together
AT_ONCE = 2  # records in one check: a driver's requests must not wait behind more of them
MOST_KEPT = 2 * MOST_PARTS  # largest number of parts with a state here; some may not exist any more


@dataclass
class _Noted:
    level: HealthLevel | None  # of the last record; None: no record, and no level was known before
    now: HealthLevel | None
    worst: HealthLevel | None  # since the record
    words: str = ""  # of the worst
    times: int = 0  # changes since the record
    budget: TokenBucket = field(default_factory=lambda: TokenBucket(1.0 / PART_GAP_S, PART_BURST))


class HealthLog:
    """The changes of one robot's parts."""

    def __init__(self, diagnostics: Diagnostics, records: Records) -> None:
        self._diagnostics = diagnostics
        self._records = records
        self._noted: dict[str, _Noted] = {}
        self._knows_earlier = False
        self._earlier: Future[dict[str, HealthLevel]] | None = None  # levels recorded by an earlier bridge
        self._budget = TokenBucket(1.0 / ROBOT_GAP_S, ROBOT_BURST)
        self._checked_s = -math.inf
        self._left = 0  # records that this check may still write
        self._online = False
        self._since_s = -math.inf  # time since which the robot is online, or away

    def tick(self, online: bool, now_s: float) -> None:
        """Check whether a part is better or worse than its last record."""
        if online != self._online:
            self._online, self._since_s = online, now_s
        settles = now_s - self._since_s <= SETTLED_S
        if now_s - self._checked_s < CHECK_S or not (online or settles):
            return
        self._checked_s, self._left = now_s, AT_ONCE
        parts = self._diagnostics.members(now_s)
        if parts and not self._knows_earlier:
            self._read_earlier(now_s)
        if not self._knows_earlier:
            return
        names = plain_names(parts)
        for name, part in parts.items():
            may_be_away = not online or (settles and part.heard_s < self._since_s)
            if part.level != "silent" or not may_be_away:
                self._check(name, names[name], part, now_s)
        self._forget(now_s)

    def _read_earlier(self, now_s: float) -> None:
        """Request the recorded levels; request them again if the database was away."""
        if self._earlier is None:
            self._earlier = self._records.ask(self._records.sink.ill_parts, now_s)
        elif self._earlier.done() and self._earlier.exception():
            self._earlier = None
        elif self._earlier.done():
            self._noted = {
                name: _Noted(level, level, level) for name, level in self._earlier.result().items()
            }
            self._knows_earlier = True

    def _check(self, name: str, plain: str, part: Part, now_s: float) -> None:
        noted = self._noted.get(name)
        if noted is None:
            if part.level == "ok":
                return
            noted = self._noted[name] = _Noted(part.was, part.was, part.was)
        if part.level != noted.now:
            noted.now, noted.times = part.level, noted.times + 1
            waits = noted.worst if noted.worst != noted.level else None  # this level waits for its record
            if _is_worse(part.level, noted.worst) and BADNESS[part.level] >= BADNESS[waits or "ok"]:
                noted.worst, noted.words = part.level, _words(plain, part)
        if _is_worse(noted.worst, noted.level):
            if self._has_budget(noted, now_s):
                words = _words(plain, part) if noted.worst == part.level else noted.words
                self._record("health.worse", name, noted, noted.worst, words, part, now_s)
        elif noted.now != noted.level and self._has_budget(noted, now_s):
            self._record("health.better", name, noted, noted.now, _words(plain, part), part, now_s)

    def _has_budget(self, noted: _Noted, now_s: float) -> bool:
        if self._left == 0 or self._budget.wait_s(now_s) > 0.0 or not noted.budget.spend(now_s):
            return False
        self._left -= 1
        return self._budget.spend(now_s)

    def _record(
        self,
        kind: str,
        name: str,
        noted: _Noted,
        to: HealthLevel | None,
        words: str,
        part: Part,
        now_s: float,
    ) -> None:
        facts: dict[str, str | float | None] = {"part": name, "from": noted.level, "to": to}
        if to == part.level:
            facts["since_s"] = round(now_s - part.since_s, 1)
        if noted.times > 1:
            facts["times"] = noted.times
        facts["text"] = words
        self._records.own(kind, facts, now_s)
        noted.level, noted.worst, noted.times = to, noted.now, 0

    def _forget(self, now_s: float) -> None:
        """Forget parts that are well and have their full budget.

        The number of the others is bounded, too, because nodes may invent names.
        """
        for name, noted in list(self._noted.items()):
            if noted.level == noted.now == "ok" and noted.budget.is_full(now_s):
                del self._noted[name]
        for name in list(self._noted)[: max(0, len(self._noted) - MOST_KEPT)]:
            del self._noted[name]


def _is_worse(level: HealthLevel | None, than: HealthLevel | None) -> bool:
    """Return whether a level is worse. Silence is never an improvement: the last report may still be true."""
    return level != than and (level == "silent" or BADNESS[level or "ok"] > BADNESS[than or "ok"])


def _words(plain: str, part: Part) -> str:
    said = say("has stopped reporting") if part.level == "silent" else part.text
    return say("{part}: {said}", part=plain, said=said) if said else plain
