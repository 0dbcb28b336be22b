"""The goals of one action, through rclpy.

rclpy asks on the executor's thread whether it may begin a goal, and awaits the goal's end there; both answers come from
the robot's thread.
"""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Iterator
from typing import Any

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.task import Future

log = logging.getLogger(__name__)


class ActionGoal:
    """One goal: `robots.simulator.ros_side.Goal`."""

    def __init__(self, request: Any, kind: Any, executor: Executor) -> None:
        self.request = request
        self.decided: Future[bool] = Future()
        self.ended: Future[tuple[str, dict[str, Any]]] = Future()
        self._handle: Any = None  # rclpy's, once it has begun
        self._early: list[Any] = []  # feedback before that
        self._guard = threading.Lock()
        self._kind = kind
        self._executor = executor

    def accept(self) -> None:
        self._tell(self.decided, True)

    def ignore(self) -> None:
        """Begin it, and leave it without an end."""
        self.accept()

    def reject(self, text: str, /, **fields: Any) -> None:
        log.warning("refused a goal: %s", text)
        self._tell(self.decided, False)

    def succeed(self, text: str = "", /, **fields: Any) -> None:
        self._tell(self.ended, ("succeed", fields))

    def abort(self, text: str, /, **fields: Any) -> None:
        self._tell(self.ended, ("abort", fields))

    def cancel(self, text: str, /, **fields: Any) -> None:
        self._tell(self.ended, ("canceled", fields))

    def feedback(self, **fields: Any) -> None:
        message = self._kind.Feedback(**fields)
        with self._guard:
            if self._handle is None:
                self._early.append(message)
            else:
                self._handle.publish_feedback(message)

    def begin(self, handle: Any) -> None:
        """Take rclpy's handle, and publish the feedback that waits for it."""
        with self._guard:
            self._handle = handle
            for message in self._early:
                handle.publish_feedback(message)

    def _tell(self, future: Future[Any], answer: Any) -> None:
        if not future.done():
            future.set_result(answer)
            self._executor.wake()  # it looks at futures only when it is awake


class ActionGoals:
    """`robots.simulator.ros_side.Goals` of an action server."""

    def __init__(self, node: Node, executor: Executor, action: str, kind: Any) -> None:
        self._kind = kind
        self._executor = executor
        self._arrived: queue.SimpleQueue[tuple[bool, ActionGoal]] = queue.SimpleQueue()
        self._goals: dict[int, ActionGoal] = {}  # those that have not ended, by their request's identity
        self._server = ActionServer(
            node,
            kind,
            action,
            self._perform,
            goal_callback=self._ask,
            cancel_callback=self._cancel,
            # Its own: while a goal waits for the robot's thread, everything else goes on.
            callback_group=MutuallyExclusiveCallbackGroup(),
        )

    def arrived(self) -> Iterator[tuple[bool, ActionGoal]]:
        while not self._arrived.empty():
            yield self._arrived.get()

    async def _ask(self, request: Any) -> GoalResponse:
        goal = ActionGoal(request, self._kind, self._executor)
        self._arrived.put((True, goal))
        if not await goal.decided:
            return GoalResponse.REJECT
        self._goals[id(request)] = goal
        return GoalResponse.ACCEPT

    def _cancel(self, handle: Any) -> CancelResponse:
        self._arrived.put((False, self._goals[id(handle.request)]))
        return CancelResponse.ACCEPT

    async def _perform(self, handle: Any) -> Any:
        goal = self._goals[id(handle.request)]
        goal.begin(handle)
        how, fields = await goal.ended
        if how == "canceled" and not handle.is_cancel_requested:  # another goal replaced it
            how = "abort"
        getattr(handle, how)()
        del self._goals[id(handle.request)]
        return self._kind.Result(**fields)
