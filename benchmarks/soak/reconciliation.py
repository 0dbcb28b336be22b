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
ON_THEIR_WAY_S = 0.3  # velocities that were sent before a drive's end and arrived after it


class Received(Struct, frozen=True):
    """A message that reached the robot."""

    kind: str  # of the required record
    at_s: float  # Unix time
    key: str  # text, motion name, message content, or topic of a velocity; "": not known
    goal: str = ""  # identifier, if any


class Entry(Struct, frozen=True):
    """A record of the log."""

    id: int
    at_s: float  # Unix time before the commit
    kind: str
    of: int | None
    outcome: str
    details: dict[str, Any]

    @property
    def key(self) -> str:
        """Return the key of the messages that the robot receives for this request: see `Received`."""
        match self.kind:
            case "speech.start":
                return str(self.details["text"])
            case "motion.start":
                return str(self.details["motion"])
            case "publish.start":
                return str(msgspec.json.decode(self.details["fields"])["data"])
        return ""


class Log(Struct, frozen=True):
    """The whole log, and the findings of its verification."""

    entries: list[Entry]
    findings: list[str]


def unrecorded(received: Sequence[Received], log: Sequence[Entry]) -> list[str]:
    """Return in words the messages that reached the robot without an earlier record."""
    missing = [
        text
        for kind in ORDERS
        for text in _orders_without_record(_of_kind(kind, received), _of_kind(kind, log))
    ]
    return missing + _velocities_without_drive(_of_kind("drive.start", received), log)


def unfinished(log: Iterable[Entry], before_s: float) -> list[str]:
    """Return in words the requests before this time without an outcome."""
    log = list(log)
    ended = {(entry.of, entry.kind) for entry in log}
    return [
        f"{entry.kind} #{entry.id} of {entry.at_s:.3f} has no outcome"
        for entry in log
        if entry.kind in ENDS and entry.at_s < before_s and (entry.id, ENDS[entry.kind]) not in ended
    ]


def counts(received: Iterable[Received]) -> Counter[str]:
    """Return the number of messages of each kind that reached the robot."""
    return Counter(one.kind for one in received)


def _orders_without_record(received: Sequence[Received], log: Sequence[Entry]) -> list[str]:
    """Match each message with a separate, older record; return in words the messages without one.

    Goals with an unknown key are only counted.
    """
    missing = []
    if len(received) > len(log):
        missing.append(f"{len(received)} {received[0].kind} reached the robot, {len(log)} are recorded")
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
                missing.append(f"{one.kind} {key!r} reached the robot at {one.at_s:.3f} without a record")
    return missing


def _velocities_without_drive(received: Sequence[Received], log: Sequence[Entry]) -> list[str]:
    """Check that each velocity is within a drive, and that its topic, if not the default, was chosen before."""
    ends_s = {entry.of: entry.at_s for entry in log if entry.kind == "drive.end"}
    drives = [
        (entry.at_s, ends_s.get(entry.id, float("inf")) + ON_THEIR_WAY_S)
        for entry in _of_kind("drive.start", log)
    ]
    chosen_s: dict[str, float] = {DEFAULT_DRIVE_TOPIC: 0.0}
    for entry in _of_kind("topic.choose", log):
        if entry.of is None:  # otherwise it is the outcome of a choice
            chosen_s.setdefault(entry.details["to"], entry.at_s)
    missing = [
        f"a velocity on {one.key} reached the robot at {one.at_s:.3f}, in no recorded drive"
        for one in received
        if not any(start_s <= one.at_s <= end_s for start_s, end_s in drives)
    ]
    return missing + [
        f"a velocity on {one.key} reached the robot at {one.at_s:.3f}, before its choice was recorded"
        for one in received
        if one.at_s < chosen_s.get(one.key, float("inf"))
    ]


def _of_kind(kind: str, among: Iterable[Any]) -> list[Any]:
    return [one for one in among if one.kind == kind]
