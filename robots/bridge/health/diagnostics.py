"""Sum up the nodes' reports about the robot's parts (/diagnostics): level, text, since when, temperature.

Several nodes, or one node for several pieces of hardware, may report under one name. Each of these voices is followed
on its own, and the worst one that is heard stands for the part.

Pure: time is an argument. Nodes may send anything, so all stored data are bounded.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from robots.shared import wire
from robots.shared.sentences import say
from robots.shared.wire import HealthLevel

MOST_PARTS = 200
MOST_VOICES = 8  # of one part
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

Voice = tuple[str, str]  # hardware id and node


class Status(NamedTuple):
    """One diagnostic_msgs/DiagnosticStatus, with texts cut."""

    name: str
    level: int
    text: str
    values: Sequence[tuple[str, str]] = ()
    hardware: str = ""
    node: str = ""  # that reports it


@dataclass
class Part:
    """A part as one voice reports it."""

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
            text = say(
                "{reason}; silent for {age:age}",
                reason=text or say("no reason given"),
                age=now_s - self.since_s,
            )
        return wire.HealthPart(name, self.shown, text, max(0, int(now_s - self.shown_since_s)))


class Diagnostics:
    """The parts of one robot."""

    def __init__(self) -> None:
        self._parts: dict[str, dict[Voice, Part]] = {}
        # Parts beyond `MOST_PARTS`, or with voices beyond `MOST_VOICES`; also bounded
        self._left_out: set[str] = set()
        self._unread = 0
        self._view: wire.Health | None = None
        self._viewed_s = -math.inf
        self._began_s = -math.inf  # start of the robot's present run

    def restarted(self, now_s: float) -> None:
        """Note that the robot, or only its ROS, restarted: earlier reports may no longer be true."""
        self._began_s = now_s

    def observe(self, statuses: Iterable[Status], now_s: float) -> None:
        """Take a report of one node. If it has a voice more than once, the worst of its levels holds."""
        said: dict[tuple[str, Voice], list[Status]] = {}
        for status in statuses:
            name = status.name if status.name.strip("/ ") else status.hardware
            if status.level in _LEVELS and name.strip("/ "):
                said.setdefault((name, (status.hardware, status.node)), []).append(status)
            else:
                self._unread += 1
        if len(self._parts.keys() | {name for name, _ in said}) > MOST_PARTS:
            self._forget(now_s, also_ill=True)
        well = self._well(now_s)
        for (name, voice), all_said in said.items():
            worst = max(all_said, key=lambda status: BADNESS[_LEVELS[status.level]])
            level = _LEVELS[worst.level]
            if (part := self._part(name, voice, level, now_s, well)) is not None:
                part.become(level, now_s)
                part.heard_s = now_s
                if level != "silent" or part.reported == "ok":
                    part.text = worst.text
                part.temperatures = _temperatures(value for status in all_said for value in status.values)
        self._viewed_s = -math.inf

    def _part(
        self, name: str, voice: Voice, level: HealthLevel, now_s: float, well: Iterator[str]
    ) -> Part | None:
        if name not in self._parts:
            if not self._has_room(level, well):
                self._leave_out(name)
                return None
            self._left_out.discard(name)
        voices = self._parts.setdefault(name, {})
        if voice not in voices and len(voices) >= MOST_VOICES and not _make_room(voices, level, now_s):
            self._leave_out(name)
            return None
        return voices.setdefault(voice, Part(level, now_s, now_s))

    def _has_room(self, level: HealthLevel, well: Iterator[str]) -> bool:
        """Return whether there is room for a new part; an ill one takes the place of one that is well."""
        if len(self._parts) >= MOST_PARTS and level != "ok" and (other := next(well, None)) is not None:
            del self._parts[other]
            self._leave_out(other)
        return len(self._parts) < MOST_PARTS

    def _well(self, now_s: float) -> Iterator[str]:
        """Yield the parts that are well. One iterator serves a whole report, so that many names cost one pass."""
        for name, voices in list(self._parts.items()):
            if _chosen(voices, now_s).shown == "ok":
                yield name

    def _leave_out(self, name: str) -> None:
        if len(self._left_out) < MOST_PARTS:
            self._left_out.add(name)

    def _forget(self, now_s: float, *, also_ill: bool = False) -> None:
        """Forget voices that are silent for long; ill parts only with `also_ill`, to make room."""
        for name, voices in list(self._parts.items()):
            for voice, part in list(voices.items()):
                if now_s - part.heard_s <= FORGOTTEN_S:
                    continue
                if also_ill or part.reported == "ok" or _is_heard(_chosen(voices, now_s), now_s):
                    del voices[voice]
            if not voices:
                del self._parts[name]

    def view(self, now_s: float) -> wire.Health | None:
        """Return the summary; None: no node has reported."""
        if now_s - self._viewed_s >= VIEW_S:
            self._viewed_s = now_s
            self._forget(now_s)
            self._view = self._summary(now_s) if self._parts or self._unread else None
        return self._view

    def members(self, now_s: float) -> dict[str, Part]:
        """Return the parts by name. A group of an aggregator is left out, unless it is ill and no member is."""
        for voices in self._parts.values():
            for part in voices.values():
                if not _is_heard(part, now_s):
                    part.become("silent", part.heard_s)
                if part.level == "silent" and part.last_report_s < self._began_s < now_s - RESTARTED_S:
                    part.reported = "ok"  # an error of the run before may not exist in this run
        parts = {name: _chosen(voices, now_s) for name, voices in self._parts.items()}
        groups = {parent for name in parts for parent in _parents(name)}
        with_ill = {parent for name, part in parts.items() if part.level != "ok" for parent in _parents(name)}
        hidden = {name for name in groups & parts.keys() if parts[name].level == "ok" or name in with_ill}
        return {name: part for name, part in parts.items() if name not in hidden}

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
        hot: dict[str, float] = {}  # the highest of each name
        for name in members:
            for part in self._parts[name].values():
                for key, celsius in part.temperatures.items() if _is_heard(part, now_s) else ():
                    shown = _temperature_name(names[name], key, part)
                    hot[shown] = max(celsius, hot.get(shown, celsius))
        temperatures = [wire.Temperature(shown, round(celsius)) for shown, celsius in hot.items()]
        return wire.Health(
            level=ill[0][1].shown if ill else "ok",
            parts=[part.report(names[name], now_s) for name, part in ill if name in listed],
            parts_more=max(0, len(ill) - SHOWN),
            well=len(members) - len(ill),
            temperatures=sorted(temperatures, key=lambda one: (-one.celsius, one.name))[:HOTTEST],
            left_out=len(self._left_out),
            unread=self._unread,
        )


def _is_heard(part: Part, now_s: float) -> bool:
    return now_s - part.heard_s <= SILENT_S


def _make_room(voices: dict[Voice, Part], level: HealthLevel, now_s: float) -> bool:
    """Remove a voice for a new one of this level: one that is silent, else well, else less ill. Return whether."""
    voice = min(voices, key=lambda one: _worth(voices[one], now_s))
    heard, badness, _ = _worth(voices[voice], now_s)
    if heard and badness and badness >= BADNESS[level]:
        return False
    del voices[voice]
    return True


def _worth(part: Part, now_s: float) -> tuple[bool, int, float]:
    return _is_heard(part, now_s), BADNESS[part.shown], part.heard_s


def _chosen(voices: dict[Voice, Part], now_s: float) -> Part:
    """Return the worst voice that is heard, or of silent ones the worst. Of several voices the text says which."""
    heard = {voice: part for voice, part in voices.items() if _is_heard(part, now_s)} or voices
    voice = max(heard, key=lambda one: _order(heard[one]))
    part = heard[voice]
    if len(heard) == 1:
        return part
    distinct = [word for word, *others in zip(voice, *heard, strict=True) if word and len(set(others)) > 1]
    if not distinct:
        return part
    return replace(part, text=say("{text} ({names})", text=part.text, names=", ".join(distinct)))


def _order(part: Part) -> tuple[int, float]:
    """Worst last; of equal ones the ill one that was ill first, the well one that became well last."""
    since_s = part.shown_since_s
    return BADNESS[part.shown], since_s if part.shown == "ok" else -since_s


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


def _temperatures(values: Iterable[tuple[str, str]]) -> dict[str, float]:
    found: dict[str, float] = {}
    for key, value in values:
        if _TEMPERATURE.search(key) and (number := _CELSIUS.fullmatch(value)):
            celsius = float(number[1])
            if _PLAUSIBLE[0] <= celsius <= _PLAUSIBLE[1]:
                found[key] = celsius
    return found


def _temperature_name(name: str, key: str, part: Part) -> str:
    return name if len(part.temperatures) == 1 else f"{name}, {key}"
