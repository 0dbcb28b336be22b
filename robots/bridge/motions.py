"""One recorded motion at a time: asked for, put on record, begun, watched, ended, and that put on record.

Nothing here begins a motion by itself, and one that was cancelled is over: whoever wants it again asks again.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, Protocol
from uuid import uuid4

import msgspec
from msgspec import Struct

from robots import wire
from robots.bridge.drives import Answer, DriveLog, not_recorded
from robots.bridge.gate.posture import Disc
from robots.bridge.gate.sweep import Motion
from robots.bridge.sink import Holder, Parameters
from robots.wire import Refusal

FARTHEST = 100.0  # rad or m: no joint of an arm goes there
CANCEL_AGAIN_S = 0.5  # a cancel that the robot does not obey may not have reached it
UNHEARD_S = 2.0  # a goal that the robot has not spoken of for this long is given up


class _Point(Struct):
    positions: list[float]


class _Recorded(Struct):
    """What of a motion's parameters tells how it moves."""

    joints: list[str]
    points: list[_Point]


class _Time(Struct):
    time_from_start: float


class _Meta(Struct, frozen=True):
    name: str = ""
    usage: str = ""
    description: str = ""


class _Described(Struct):
    """What of a motion's parameters is for people."""

    meta: _Meta = _Meta()
    points: list[_Time] = []


def recorded(parameters: Any, listed: Collection[str] | None = None) -> dict[str, Motion | None]:
    """A robot's motions by name, from play_motion's parameters; None: it has one of which no points are known.

    `listed`: those that its service names; None: it names none, and all that have parameters count.
    """
    told = _told(parameters)
    return {name: _recorded(told.get(name)) for name in sorted(told if listed is None else listed)}


def offered(parameters: Any, listed: Mapping[str, float] | None = None) -> list[wire.MotionOffer]:
    """The same motions for people. `listed` has their durations in seconds; 0: the robot does not say."""
    told = _told(parameters)
    durations = listed or {}
    names = sorted(told if listed is None else listed)
    return [_offer(name, told.get(name), durations.get(name, 0.0)) for name in names]


def _told(parameters: Any) -> dict[str, Any]:
    return {str(name): told for name, told in parameters.items()} if isinstance(parameters, dict) else {}


def _recorded(told: Any) -> Motion | None:
    try:
        motion = msgspec.convert(told, _Recorded)
    except msgspec.ValidationError:
        return None
    points = tuple(tuple(point.positions) for point in motion.points)
    fit = all(len(point) == len(motion.joints) and all(map(_possible, point)) for point in points)
    return Motion(tuple(motion.joints), points) if points and fit else None


def _possible(position: float) -> bool:
    """Whether a joint can be there; not if it is no number."""
    return abs(position) <= FARTHEST


def _offer(name: str, told: Any, duration_s: float) -> wire.MotionOffer:
    try:
        known = msgspec.convert(told, _Described)
    except msgspec.ValidationError:
        known = _Described()
    if not duration_s and known.points:
        duration_s = known.points[-1].time_from_start
    meta = known.meta
    return wire.MotionOffer(
        name=name,
        title=meta.name or name,
        usage=meta.usage,
        description=meta.description,
        duration_s=round(duration_s, 1) if 0.0 < duration_s < math.inf else None,
    )


class Player(Protocol):
    """What performs motions."""

    def play(self, goal_id: str, motion: str, action: str) -> None:
        """Send the goal."""

    def cancel(self, goal_id: str, action: str) -> None:
        """Cancel this goal and no other."""


@dataclass
class _Playing:
    """A motion that was asked for; it has a goal once its start is on record."""

    name: str
    action: str  # that performs it
    holder: Holder
    space: Sequence[Disc]  # that its arm sweeps
    since_s: float
    number: Future[int]
    answer: Answer
    goal_id: str | None = None
    heard_s: float = math.inf
    cancelled: tuple[str, str] | None = None  # outcome, and why in words
    cancel_sent_s: float | None = None  # no later than this


class Motions:
    """The motion under way, if any: this console's own, or somebody else's, of which only goal ids are known."""

    def __init__(self, player: Player, log: DriveLog) -> None:
        self._player = player
        self._log = log
        self._playing: _Playing | None = None
        self._last: wire.MotionEnd | None = None
        self._ended: str | None = None  # the last one's goal, of which an older word may still come
        self._others: dict[
            str, float
        ] = {}  # actions where others have the robot perform something: told last

    def refuse(self, now_s: float) -> Refusal | None:
        """Why the base must stand, and no other motion may begin: one runs."""
        playing = self._playing
        if playing is not None:
            text = f"The robot performs “{playing.name}”, asked for by {playing.holder.holder}."
            figures: dict[str, float | int | str | None] = {
                "motion": playing.name,
                "who": playing.holder.holder,
            }
            return Refusal("motion_running", text, "robot", figures)
        if any(now_s - told_s <= UNHEARD_S for told_s in self._others.values()):
            return Refusal("motion_running", "The robot performs a motion that others asked for.", "robot")
        return None

    def begin(
        self,
        name: str,
        action: str,
        holder: Holder,
        space: Sequence[Disc],
        now_s: float,
        answer: Answer,
    ) -> None:
        """Put it on record; `start` follows once that is done, and answers."""
        number = self._log.request(holder, "motion.start", {"motion": name, "topic": action}, now_s)
        self._playing = _Playing(name, action, holder, space, now_s, number, answer)

    @property
    def topic(self) -> str | None:
        """The action that performs this console's motion."""
        return self._playing.action if self._playing else None

    @property
    def due(self) -> bool:
        """Whether a motion is on record and waits to be started."""
        playing = self._playing
        return playing is not None and playing.goal_id is None and playing.number.done()

    @property
    def space(self) -> Sequence[Disc]:
        """What the arm of this console's motion sweeps; nothing once it is cancelled."""
        playing = self._playing
        return playing.space if playing is not None and playing.cancelled is None else ()

    def start(self, now_s: float) -> None:
        """Send the goal of what is due; what could not be recorded, or was cancelled meanwhile, is not done."""
        playing = self._playing
        if playing is None:
            return
        if error := playing.number.exception():
            self._playing = None
            playing.answer(not_recorded(error))
            return
        playing.answer(None)
        if playing.cancelled is not None:
            self._end("cancelled", "", now_s)
        else:
            playing.goal_id, playing.heard_s = f"fleet_bridge-{uuid4()}", now_s
            self._player.play(playing.goal_id, playing.name, playing.action)

    def cancel(self, outcome: str, why: str) -> bool:
        """Cancel this console's motion by its goal's id. Whether there was one."""
        playing = self._playing
        if playing is None:
            return False
        if playing.cancelled is None:
            playing.cancelled = (outcome, why)
            if playing.goal_id is not None:
                self._player.cancel(playing.goal_id, playing.action)
        return True

    def running(self, action: str, goal_ids: Collection[str], now_s: float) -> None:
        """The robot says which goals are under way."""
        playing = self._playing
        if set(goal_ids) - {playing.goal_id if playing else None, self._ended}:
            self._others[action] = now_s
        else:
            self._others.pop(action, None)
        if playing is not None and playing.goal_id in goal_ids:
            playing.heard_s = now_s

    def ended(self, goal_id: str, outcome: str, text: str, now_s: float) -> None:
        """The robot says that a goal has ended."""
        if self._playing is not None and self._playing.goal_id == goal_id:
            self._end(outcome, text, now_s)

    def tick(self, now_s: float) -> None:
        """Repeat a cancel until the robot obeys; give up a goal of which it does not speak any more."""
        playing = self._playing
        if playing is None:
            return
        if now_s - playing.heard_s > UNHEARD_S:
            self.cancel("unheard", f"The robot did not speak of it for {UNHEARD_S:.0f} s.")
            self._end("cancelled", "", now_s)
        elif playing.cancelled is not None and playing.goal_id is not None:
            if playing.cancel_sent_s is None:
                playing.cancel_sent_s = now_s
            elif now_s - playing.cancel_sent_s >= CANCEL_AGAIN_S:
                playing.cancel_sent_s = now_s
                self._player.cancel(playing.goal_id, playing.action)

    def close(self, now_s: float) -> None:
        """The bridge ends, and with it whoever could watch the motion."""
        if self._playing and self._playing.goal_id:
            self.cancel("control_ended", "The bridge ended.")
            self._end("cancelled", "", now_s)

    def view(self, now_s: float) -> wire.Motion | None:
        """What is under way, for pages."""
        playing = self._playing
        if playing is None:
            return None
        return wire.Motion(playing.name, playing.holder.holder, round(now_s - playing.since_s, 1))

    @property
    def last(self) -> wire.MotionEnd | None:
        """How the last one ended, for pages."""
        return self._last

    def _end(self, outcome: str, text: str, now_s: float) -> None:
        """What ended as cancelled ended for the reason for which it was cancelled here, if it was."""
        playing, self._playing = self._playing, None
        if playing is not None:
            self._ended = playing.goal_id
            if outcome == "cancelled" and playing.cancelled is not None:
                outcome, text = playing.cancelled
            number = playing.number.result()
            self._last = wire.MotionEnd(number, playing.name, outcome, text)
            figures: Parameters = {
                "motion": playing.name,
                "duration_s": round(now_s - playing.since_s, 2),
                "text": text,
            }
            self._log.outcome(playing.number, playing.holder, "motion.end", outcome, figures, now_s)
