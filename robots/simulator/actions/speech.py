"""The action that speaks: one voice, so a newer goal replaces an older one."""

from __future__ import annotations

from typing import Any, NamedTuple

from robots.simulator.ros_side import Goal, Goals
from robots.simulator.speech import Mark, Utterance, objection


class Asked(NamedTuple):
    """The words that a goal asks for. `wait_s`: silence before it."""

    text: str
    language: str
    wait_s: float


class SpeechServer:
    """Speaks the texts of goals. `ros` and `ros2` have the fields of goal, feedback and result."""

    def __init__(self, goals: Goals) -> None:
        self._goals = goals
        self._speaking: tuple[Goal, Utterance] | None = None

    def step(self, now: float) -> None:
        """Take new goals and cancels, then continue to speak."""
        for is_new, goal in self._goals.arrived():
            if is_new:
                self._interrupt("a newer goal took over")
                self._begin(goal, now)
            elif self._speaking is not None and goal == self._speaking[0]:
                self._interrupt("cancelled")
        self._go_on(now)

    def _asked(self, request: Any) -> Asked:
        """Read a goal."""
        raise NotImplementedError

    def _mark(self, goal: Goal, mark: Mark) -> None:
        """Report a word that begins, or the end."""
        raise NotImplementedError

    def _reason(self, why: str) -> dict[str, Any]:
        """Return the fields of a result without success."""
        raise NotImplementedError

    def _spoken(self, text: str) -> dict[str, Any]:
        """Return the fields of a result with success."""
        return {"text": text}

    def _begin(self, goal: Goal, now: float) -> None:
        goal.accept()
        asked = self._asked(goal.request)
        if (why := objection(asked.text, asked.language)) is not None:
            goal.abort(why, **self._reason(why))
            return
        self._speaking = goal, Utterance(asked.text, asked.wait_s, now)

    def _interrupt(self, why: str) -> None:
        if self._speaking is not None:
            goal, _ = self._speaking
            self._speaking = None
            goal.cancel(why, **self._reason(why))

    def _go_on(self, now: float) -> None:
        if self._speaking is None:
            return
        goal, utterance = self._speaking
        for mark in utterance.marks(now):
            self._mark(goal, mark)
        if utterance.is_over(now):
            self._speaking = None
            goal.succeed(**self._spoken(self._asked(goal.request).text))
