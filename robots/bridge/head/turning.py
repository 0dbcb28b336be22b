"""A turn of the head that its holder asked for, on its way. It ends as the robot's action says, or by joint states."""

from __future__ import annotations

from typing import NamedTuple

from robots.bridge.head.head import Aim
from robots.shared import wire
from robots.shared.sentences import say

THERE_RAD = 0.05  # a joint within this angle of its aim has arrived
MOVED_RAD = 0.01  # smaller changes are noise of joint states
STILL_S = 2.0  # a head that has not moved for this time, and should be there, goes no further


class Result(NamedTuple):
    """How a turn ended."""

    outcome: str  # as in `wire.HeadEnd`
    text: str = ""


class Turning:
    """One turn. `goal`: the id of its goal, if the robot's action carries it out and tells the end."""

    def __init__(self, order: wire.TurnHead, aim: Aim, goal: str | None, now_s: float) -> None:
        self.order = order
        self.goal = goal
        self._aim = aim
        self._due_s = now_s + aim.seconds
        self._moved_s = self._due_s
        self._at: tuple[float, float] | None = None  # at `_moved_s`

    def look(self, at: tuple[float, float] | None, now_s: float) -> Result | None:
        """Return how the turn ended by the head's position (pan and tilt; None: unknown); None: it goes on."""
        if at is not None and not _near(at, self._at, MOVED_RAD):
            self._at, self._moved_s = at, max(now_s, self._due_s)
        if now_s < self._due_s:
            return None
        is_there = _near(self._aim[:2], at, THERE_RAD)
        if self.goal is None and (is_there or at is None):
            return Result("done" if is_there else "sent")
        if now_s - self._moved_s <= STILL_S:
            return None
        if at is None:
            return Result("unheard", say("The robot did not report it for {seconds:.0f} s.", seconds=STILL_S))
        return Result("done") if is_there else Result("not_there", say("The head stopped on its way."))


def reported(outcome: str, text: str) -> Result:
    """Return the result by the words of the robot's action."""
    if outcome == "cancelled":
        return Result("taken_over", say("Something else on the robot took the head over."))
    return Result("done") if outcome == "succeeded" else Result(outcome, text)


def _near(wanted: tuple[float, float], at: tuple[float, float] | None, most: float) -> bool:
    return at is not None and all(abs(a - b) <= most for a, b in zip(wanted, at, strict=True))
