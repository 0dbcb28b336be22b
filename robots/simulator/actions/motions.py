"""The action that plays motions."""

from __future__ import annotations

from typing import Any

from robots.simulator.joints.motions import ErrorCode, Phase, RefusedError, Run
from robots.simulator.robot import Robot
from robots.simulator.ros_side import Goal, Goals


class MotionServer:
    """Performs goals. `ros` and `ros2` have its services and its results."""

    def __init__(self, robot: Robot, goals: Goals) -> None:
        self._robot = robot
        self._player = robot.player
        self._goals = goals
        self._running: list[tuple[Goal, Run]] = []

    def step(self, now: float) -> None:
        """Take new goals and cancels, then report which motions ended."""
        for is_new, goal in self._goals.arrived():
            if is_new:
                self._begin(goal, now)
            else:
                self._cancel(goal)
        for goal, run in self._running[:]:
            if run.phase is not Phase.MOVING:
                self._running.remove((goal, run))
                self._report_end(goal, run)

    def _result(self, code: int, text: str) -> dict[str, Any]:
        """Return the fields of a result."""
        raise NotImplementedError

    def _begin(self, goal: Goal, now: float) -> None:
        try:
            run = self._player.start(goal.request.motion_name, now, fails=self._robot.faults.motion_fails)
        except RefusedError as refused:
            goal.reject(str(refused), **self._result(int(refused.code), str(refused)))
            return
        goal.accept()
        self._running.append((goal, run))

    def _cancel(self, goal: Goal) -> None:
        for running, run in self._running[:]:
            if running == goal:
                self._player.cancel(run)
                self._running.remove((running, run))
                running.cancel("cancelled")

    def _report_end(self, goal: Goal, run: Run) -> None:
        if run.phase is Phase.DONE:
            goal.succeed(**self._result(int(ErrorCode.SUCCEEDED), ""))
        else:
            text = "the joints did not reach their goal"
            goal.abort(text, **self._result(int(ErrorCode.GOAL_NOT_REACHED), text))
