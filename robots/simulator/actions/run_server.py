"""The base of actions whose goals move joints."""

from __future__ import annotations

from typing import Any

from robots.simulator.joints.motions import Phase, Player, Run
from robots.simulator.ros_side import Goal, Goals


class RunServer:
    """An action whose goals are runs of joints. A new goal, or another run of the same joints, replaces it."""

    def __init__(self, player: Player, goals: Goals) -> None:
        self._player = player
        self._goals = goals
        self._running: tuple[Goal, Run, Any] | None = None  # goal, run, and its aim

    def take_goals(self, now: float) -> None:
        """Take goals and cancels since the last tick, then report whether the goal ended."""
        for is_new, goal in self._goals.arrived():
            if is_new:
                self._begin(goal, now)
            elif self._running is not None and self._running[0] == goal:
                self._player.cancel(self._running[1])
                self._report_end()
        self._report_end()

    def _begin(self, goal: Goal, now: float) -> None:
        """Accept or reject a new goal."""
        raise NotImplementedError

    def _end(self, goal: Goal, run: Run, aim: Any) -> None:
        """Report the end of a goal."""
        raise NotImplementedError

    def _accept(self, goal: Goal, run: Run, aim: Any) -> None:
        self._report_end()  # of the previous goal, which this goal replaced
        goal.accept()
        self._running = goal, run, aim

    def _report_end(self) -> None:
        if self._running is not None and self._running[1].phase is not Phase.MOVING:
            ended, self._running = self._running, None
            self._end(*ended)
