"""Base of the simulated robot's action servers."""

from __future__ import annotations

import queue
from collections.abc import Iterator
from typing import Any

from actionlib import ActionServer
from actionlib_msgs.msg import GoalStatus

from robots.shared.ros.message_types.classes import message_class


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
