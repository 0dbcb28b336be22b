"""Bases of the simulated robot's action servers."""

from __future__ import annotations

import queue
from collections.abc import Iterator
from typing import Any

from actionlib import ActionServer
from actionlib_msgs.msg import GoalStatus

from robots.shared.ros.message_types.classes import message_class
from robots.simulator.joints.motions import Phase, Player, Run


class Goals:
    """Goals and cancels of one action, passed from actionlib's threads to the robot's thread."""

    def __init__(self, name: str, action_type: str) -> None:
        self._arrived: queue.SimpleQueue[tuple[bool, Any]] = queue.SimpleQueue()
        self._server = ActionServer(
            name,
            message_class(action_type),
            goal_cb=lambda handle: self._arrived.put((True, handle)),
            cancel_cb=lambda handle: self._arrived.put((False, handle)),
            auto_start=False,
        )
        self._server.start()

    def arrived(self) -> Iterator[tuple[bool, Any]]:
        """Yield the messages since the last call, in order: (True, new goal) or (False, goal to cancel)."""
        while not self._arrived.empty():
            is_goal, handle = self._arrived.get()
            if is_goal and handle.get_goal_status().status == GoalStatus.RECALLING:
                handle.set_canceled(text="cancelled before it was begun")
            else:
                yield is_goal, handle


class RunServer:
    """An action whose goals are runs of joints. A new goal, or another run of the same joints, replaces it."""

    def __init__(self, player: Player, name: str, action_type: str) -> None:
        self._player = player
        self._goals = Goals(name, action_type)
        self._running: tuple[Any, Run, Any] | None = None  # handle, run, and its aim

    def take_goals(self, now: float) -> None:
        """Take goals and cancels since the last tick, then report whether the goal ended."""
        for is_goal, handle in self._goals.arrived():
            if is_goal:
                self._begin(handle, now)
            elif self._running is not None and self._running[0] == handle:
                self._player.cancel(self._running[1])
                self._report_end()
        self._report_end()

    def _begin(self, handle: Any, now: float) -> None:
        """Accept or reject a new goal."""
        raise NotImplementedError

    def _end(self, handle: Any, run: Run, aim: Any) -> None:
        """Report the end of a goal."""
        raise NotImplementedError

    def _accept(self, handle: Any, run: Run, aim: Any) -> None:
        self._report_end()  # of the previous goal, which this goal replaced
        handle.set_accepted()
        self._running = handle, run, aim

    def _report_end(self) -> None:
        if self._running is not None and self._running[1].phase is not Phase.MOVING:
            ended, self._running = self._running, None
            self._end(*ended)
