"""Sum up the nodes' reports about the robot's parts (/diagnostics): level, text, since when, temperature.

Pure: time is an argument. Nodes may send anything, so all stored data are bounded.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from robots import wire
from robots.bridge.gate.words import age
from robots.wire import HealthLevel

MOST_PARTS = 200
SILENT_S = 10.0  # nodes report once a second
FORGOTTEN_S = 600.0  # a part that was well and is silent for this time is not listed any more
RESTARTED_S = 60.0  # after a restart of the robot: a part without a report by then may be gone
SHOWN = 8  # parts that are not well
NEWEST = 3  # of them, at least: the parts that got worse last; the page announces only parts it receives
HOTTEST = 6  # temperatures
VIEW_S = 1.0  # between two views without a new report

_LEVELS: dict[int, HealthLevel] = {0: "ok", 1: "warning", 2: "error", 3: "silent"}  # DiagnosticStatus
BADNESS: dict[HealthLevel, int] = {"ok": 0, "silent": 1, "warning": 2, "error": 3}
_TEMPERATURE = re.compile(r"(?i)temperature|\btemp\b|_temp$|^temp_")
_CELSIUS = re.compile(r"\s*(-?\d{1,3}(?:\.\d{1,9})?)\s*(?:°?\s*C|celsius|degrees)?\s*", re.IGNORECASE)
_PLAUSIBLE = (-40.0, 200.0)  # °C


class Status(NamedTuple):
    """One diagnostic_msgs/DiagnosticStatus, with texts cut."""

    name: str
    level: int
    text: str
    values: Sequence[tuple[str, str]] = ()


@dataclass
class Part:
    """A part as its node reports it."""

    level: HealthLevel
    since_s: float
    heard_s: float
    reported: HealthLevel = "ok"  # the last level that its node reported
    reported_since_s: float = 0.0  # since when `reported` has this value
    reported_before: HealthLevel | None = None  # the level before `reported`
    last_report_s: float = 0.0  # time of the node's last report
    text: str = ""  # text of this report
    temperatures: dict[str, float] = field(default_factory=dict)  # °C, by key
    was: HealthLevel | None = None  # the level before this one; None: no report before

    def become(self, level: HealthLevel, since_s: float) -> None:
        """Take a level. `since_s` is kept for the same level, also if an ill part was silent in between."""
        if level != self.level:
            if self.level == "silent" and level == self.reported != "ok":
                self.was, self.since_s = self.reported_before, self.reported_since_s
            else:
                self.was, self.since_s = self.shown, since_s
            self.level = level
        if level != "silent":
            self.last_report_s = since_s
        if level not in ("silent", self.reported):
            self.reported, self.reported_since_s, self.reported_before = level, self.since_s, self.was

    @property
    def shown(self) -> HealthLevel:
        """The level for people. Silence is never an improvement: a reported error may still exist."""
        return self.reported if self.level == "silent" and self.reported != "ok" else self.level

    @property
    def shown_since_s(self) -> float:
        """The time since which the part has the `shown` level."""
        return self.since_s if self.level == self.shown else self.reported_since_s

    @property
    def got_worse(self) -> bool:
        """Return whether its level got worse at the last change."""
        return self.level == "silent" or BADNESS[self.level] > BADNESS[self.was or "ok"]

    def report(self, name: str, now_s: float) -> wire.HealthPart:
        """Return the part for people."""
        text = self.text
        if self.level != self.shown:
            text = f"{text or 'no reason given'}; silent for {age(now_s - self.since_s)}"
        return wire.HealthPart(name, self.shown, text, max(0, int(now_s - self.shown_since_s)))


class Diagnostics:
    """The parts of one robot."""

    def __init__(self) -> None:
        self._parts: dict[str, Part] = {}
        self._left_out: set[str] = set()  # names of parts beyond `MOST_PARTS`; also bounded
        self._unread = 0
        self._view: wire.Health | None = None
        self._viewed_s = -math.inf
        self._began_s = -math.inf  # start of the robot's present run

    def restarted(self, now_s: float) -> None:
        """Note that the robot, or only its master, restarted: earlier reports may no longer be true."""
        self._began_s = now_s

    def take(self, statuses: Iterable[Status], now_s: float) -> None:
        """Take a report of one node."""
        for status in statuses:
            level = _LEVELS.get(status.level)
            if level is None or not status.name.strip("/ "):
                self._unread += 1
            elif (part := self._part(status.name, level, now_s)) is not None:
                part.become(level, now_s)
                part.heard_s = now_s
                if level != "silent" or part.reported == "ok":
                    part.text = status.text
                part.temperatures = _temperatures(status.values)
        self._viewed_s = -math.inf

    def _part(self, name: str, level: HealthLevel, now_s: float) -> Part | None:
        part = self._parts.get(name)
        if part is None and len(self._parts) >= MOST_PARTS:
            self._forget(now_s, also_ill=True)
        if part is None and len(self._parts) >= MOST_PARTS:
            if len(self._left_out) < MOST_PARTS:
                self._left_out.add(name)
            return None
        return part or self._parts.setdefault(name, Part(level, now_s, now_s))

    def _forget(self, now_s: float, *, also_ill: bool = False) -> None:
        """Forget parts that are silent for long; ill parts only with `also_ill`, to make room."""
        for name, part in list(self._parts.items()):
            if now_s - part.heard_s > FORGOTTEN_S and (also_ill or part.reported == "ok"):
                del self._parts[name]

    def view(self, now_s: float) -> wire.Health | None:
        """Return the summary; None: no node has reported."""
        if now_s - self._viewed_s >= VIEW_S:
            self._viewed_s = now_s
            self._forget(now_s)
            self._view = self._summary(now_s) if self._parts or self._unread else None
        return self._view

    def members(self, now_s: float) -> dict[str, Part]:
        """Return the parts by name. An aggregator’s group is left out: its members are more exact."""
        for part in self._parts.values():
            if now_s - part.heard_s > SILENT_S:
                part.become("silent", part.heard_s)
            if part.level == "silent" and part.last_report_s < self._began_s < now_s - RESTARTED_S:
                part.reported = "ok"  # an error of the run before may not exist in this run
        groups = {parent for name in self._parts for parent in _parents(name)}
        return {name: part for name, part in self._parts.items() if name not in groups}

    def _summary(self, now_s: float) -> wire.Health:
        members = self.members(now_s)
        names = plain_names(members)
        ill = sorted(
            ((name, part) for name, part in members.items() if part.level != "ok"),
            key=lambda item: (-BADNESS[item[1].shown], item[1].shown_since_s, item[0]),
        )
        worse = sorted((-part.since_s, name) for name, part in ill if part.got_worse)
        listed = [*(name for _, name in worse[:NEWEST]), *(name for name, _ in ill)]
        listed = list(dict.fromkeys(listed))[:SHOWN]
        hot = [
            wire.Temperature(_temperature_name(names[name], key, part), round(celsius))
            for name, part in members.items()
            if now_s - part.heard_s <= SILENT_S
            for key, celsius in part.temperatures.items()
        ]
        return wire.Health(
            level=ill[0][1].shown if ill else "ok",
            parts=[part.report(names[name], now_s) for name, part in ill if name in listed],
            parts_more=max(0, len(ill) - SHOWN),
            well=len(members) - len(ill),
            temperatures=sorted(hot, key=lambda one: (-one.celsius, one.name))[:HOTTEST],
            left_out=len(self._left_out),
            unread=self._unread,
        )


def plain_name(name: str) -> str:
    """Return the last part of an aggregator's path; of other names, only slashes at both ends are removed."""
    return name.rstrip("/").rsplit("/", 1)[-1].strip() if name.startswith("/") else name.strip("/ ")


def plain_names(names: Collection[str]) -> dict[str, str]:
    """Return plain names, by name. Parts with the same plain name keep their whole names."""
    plain = {name: plain_name(name) for name in names}
    count = Counter(plain.values())
    return {name: short if count[short] == 1 else name for name, short in plain.items()}


def _parents(name: str) -> Iterable[str]:
    if name.startswith("/"):
        at = name.rfind("/")
        while at > 0:
            yield name[:at]
            at = name.rfind("/", 0, at)


def _temperatures(values: Sequence[tuple[str, str]]) -> dict[str, float]:
    found: dict[str, float] = {}
    for key, value in values:
        if _TEMPERATURE.search(key) and (number := _CELSIUS.fullmatch(value)):
            celsius = float(number[1])
            if _PLAUSIBLE[0] <= celsius <= _PLAUSIBLE[1]:
                found[key] = celsius
    return found


def _temperature_name(name: str, key: str, part: Part) -> str:
    return name if len(part.temperatures) == 1 else f"{name}, {key}"
