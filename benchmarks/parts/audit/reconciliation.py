"""Compare messages that reached a robot with the audit log: each must have an earlier record."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from typing import Any

import msgspec
from msgspec import Struct

ORDERS = ("speech.start", "motion.start", "publish.start")
ENDS = {
    "drive.start": "drive.end",
    "gate.begin": "gate.end",
    **{kind: kind.replace("start", "end") for kind in ORDERS},
}
DEFAULT_DRIVE_TOPIC = "/key_vel"
ON_THEIR_WAY_S = 0.3  # velocities that were sent before a drive's end, and came after


class Received(Struct, frozen=True):
    """Something that reached the robot."""

    kind: str  # of the record that there must be
    at_s: float  # Unix time
    key: str  # the text, the motion's name, the message's content; of a velocity its topic; "": not known
    goal: str = ""  # its identifier, if it has one


class Entry(Struct, frozen=True):
    """A record of the log."""

    id: int
    at_s: float  # Unix time, taken before it was committed
    kind: str
    of: int | None
    outcome: str
    details: dict[str, Any]

    @property
    def key(self) -> str:
        """Return the messages that the robot receives for this request: see `Received`."""
        match self.kind:
            case "speech.start":
                return str(self.details["text"])
            case "motion.start":
                return str(self.details["motion"])
            case "publish.start":
                return str(msgspec.json.decode(self.details["fields"])["data"])
        return ""


class Log(Struct, frozen=True):
    """The whole log, and whether its chains are as they were written."""

    entries: list[Entry]
    findings: list[str]


def unrecorded(received: Sequence[Received], log: Sequence[Entry]) -> list[str]:
    """Return, in words, messages that reached the robot without an earlier record."""
    missing = [
        text
        for kind in ORDERS
        for text in _orders_without_record(_of_kind(kind, received), _of_kind(kind, log))
    ]
    return missing + _velocities_without_drive(_of_kind("drive.start", received), log)


def unfinished(log: Iterable[Entry], before_s: float) -> list[str]:
    """Return, in words, requests before that time without an outcome."""
    log = list(log)
    ended = {(entry.of, entry.kind) for entry in log}
    return [
        f"{entry.kind} #{entry.id} of {entry.at_s:.3f} has no outcome"
        for entry in log
        if entry.kind in ENDS and entry.at_s < before_s and (entry.id, ENDS[entry.kind]) not in ended
    ]


def counts(received: Iterable[Received]) -> Counter[str]:
    """Return how much of each kind reached the robot."""
    return Counter(one.kind for one in received)


def _orders_without_record(received: Sequence[Received], log: Sequence[Entry]) -> list[str]:
    """Each needs a record of its own that is older. Where only a goal's number is known, they are at least counted."""
    missing = []
    if len(received) > len(log):
        missing.append(f"{len(received)} {received[0].kind} reached the robot, {len(log)} are on record")
    recorded_s = defaultdict(list)
    for entry in log:
        recorded_s[entry.key].append(entry.at_s)
    heard = defaultdict(list)
    for one in received:
        if one.key:
            heard[one.key].append(one)
    for key, ones in heard.items():
        times_s = sorted(recorded_s[key])
        for place, one in enumerate(sorted(ones, key=lambda one: one.at_s)):
            if place >= len(times_s) or times_s[place] > one.at_s:
                missing.append(
                    f"{one.kind} {key!r} reached the robot at {one.at_s:.3f} and was not on record"
                )
    return missing


def _velocities_without_drive(received: Sequence[Received], log: Sequence[Entry]) -> list[str]:
    """Each lies within a drive; on another topic than the default, after that was chosen."""
    ends_s = {entry.of: entry.at_s for entry in log if entry.kind == "drive.end"}
    drives = [
        (entry.at_s, ends_s.get(entry.id, float("inf")) + ON_THEIR_WAY_S)
        for entry in _of_kind("drive.start", log)
    ]
    chosen_s: dict[str, float] = {DEFAULT_DRIVE_TOPIC: 0.0}
    for entry in _of_kind("topic.choose", log):
        if entry.of is None:  # else it is how a choice ended
            chosen_s.setdefault(entry.details["to"], entry.at_s)
    missing = [
        f"a velocity on {one.key} reached the robot at {one.at_s:.3f}, in no drive that is on record"
        for one in received
        if not any(start_s <= one.at_s <= end_s for start_s, end_s in drives)
    ]
    return missing + [
        f"a velocity on {one.key} reached the robot at {one.at_s:.3f}, before that was chosen on record"
        for one in received
        if one.at_s < chosen_s.get(one.key, float("inf"))
    ]


def _of_kind(kind: str, among: Iterable[Any]) -> list[Any]:
    return [one for one in among if one.kind == kind]
