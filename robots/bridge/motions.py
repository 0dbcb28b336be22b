"""One recorded motion at a time: asked for, put on record, begun, watched, ended, and that put on record.

Nothing here begins a motion by itself, and one that was cancelled is over: whoever wants it again asks again.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, Protocol
from uuid import uuid4

import msgspec
from msgspec import Struct

from robots import wire
from robots.bridge.drives import DriveLog
from robots.bridge.gate.posture import Disc
from robots.bridge.gate.sweep import Motion
from robots.bridge.sink import Holder, Parameters
from robots.wire import Refusal

UNHEARD_S = 2.0  # a goal that the robot has not spoken of for this long is given up


class _Point(Struct):
    positions: list[float]


class _Recorded(Struct):
    joints: list[str]
    points: list[_Point]


def recorded(parameters: Any) -> dict[str, Motion | None]:
    """A robot's motions by name, from play_motion's parameters; None: it has one of which no points are known."""
    if not isinstance(parameters, dict):
        return {}
    return {str(name): _recorded(told) for name, told in sorted(parameters.items())}


def _recorded(told: Any) -> Motion | None:
    try:
        motion = msgspec.convert(told, _Recorded)
    except msgspec.ValidationError:
        return None
    points = tuple(tuple(point.positions) for point in motion.points)
    fit = all(len(point) == len(motion.joints) and all(map(math.isfinite, point)) for point in points)
    return Motion(tuple(motion.joints), points) if points and fit else None


class Player(Protocol):
    """What performs motions."""

    def play(self, goal_id: str, motion: str) -> None:
        """Send the goal."""

    def cancel(self, goal_id: str) -> None:
        """Cancel this goal and no other."""


@dataclass
class _Playing:
    """A motion that was asked for; it has a goal once its start is on record."""

    name: str
    holder: Holder
    space: Sequence[Disc]  # that its arm sweeps
    since_s: float
    number: Future[int]
    goal_id: str | None = None
    heard_s: float = math.inf
    cancelled: tuple[str, str] | None = None  # outcome, and why in words


class Motions:
    """The motion under way, if any: this console's own, or somebody else's, of which only goal ids are known."""

    def __init__(self, player: Player, log: DriveLog) -> None:
        self._player = player
        self._log = log
        self._playing: _Playing | None = None
        self._last: wire.MotionEnd | None = None
        self._running: Collection[str] = ()
        self._running_s = -math.inf

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
        if self._running and now_s - self._running_s <= UNHEARD_S:
            return Refusal("motion_running", "The robot performs a motion that others asked for.", "robot")
        return None

    def begin(self, name: str, holder: Holder, space: Sequence[Disc], now_s: float) -> None:
        """Put it on record; `start` follows once that is done."""
        number = self._log.request(holder, "motion.start", {"motion": name}, now_s)
        self._playing = _Playing(name, holder, space, now_s, number)

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
        if playing is None or playing.number.exception() is not None:
            self._playing = None
        elif playing.cancelled is not None:
            self._end("cancelled", "", now_s)
        else:
            playing.goal_id, playing.heard_s = f"fleet_bridge-{uuid4()}", now_s
            self._player.play(playing.goal_id, playing.name)

    def cancel(self, outcome: str, why: str) -> bool:
        """Cancel this console's motion by its goal's id. Whether there was one."""
        playing = self._playing
        if playing is None:
            return False
        if playing.cancelled is None:
            playing.cancelled = (outcome, why)
            if playing.goal_id is not None:
                self._player.cancel(playing.goal_id)
        return True

    def running(self, goal_ids: Collection[str], now_s: float) -> None:
        """The robot says which goals are under way."""
        self._running, self._running_s = goal_ids, now_s
        if self._playing is not None and self._playing.goal_id in goal_ids:
            self._playing.heard_s = now_s

    def ended(self, goal_id: str, outcome: str, text: str, now_s: float) -> None:
        """The robot says that a goal has ended."""
        self._running = [other for other in self._running if other != goal_id]
        if self._playing is not None and self._playing.goal_id == goal_id:
            self._end(outcome, text, now_s)

    def tick(self, now_s: float) -> None:
        """Give up a goal of which the robot does not speak any more."""
        playing = self._playing
        if playing is not None and now_s - playing.heard_s > UNHEARD_S:
            self.cancel("unheard", f"The robot did not speak of it for {UNHEARD_S:.0f} s.")
            self._end("cancelled", "", now_s)

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
            if outcome == "cancelled" and playing.cancelled is not None:
                outcome, text = playing.cancelled
            number = playing.number.result()
            self._last = wire.MotionEnd(number, playing.name, outcome, text)
            figures: Parameters = {
                "motion": playing.name,
                "duration_s": round(now_s - playing.since_s, 2),
                "text": text,
            }
            self._log.outcome(number, playing.holder, "motion.end", outcome, figures, now_s)
