"""The goals of one action, through actionlib."""

from __future__ import annotations

import queue
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from actionlib import ActionServer
from actionlib_msgs.msg import GoalStatus

from robots.shared.ros.message_types.classes import message_class


@dataclass(frozen=True)
class ActionGoal:
    """One goal: `robots.simulator.ros_side.Goal`."""

    handle: Any
    kind: str = field(compare=False)

    @property
    def request(self) -> Any:
        return self.handle.get_goal()

    def accept(self) -> None:
        self.handle.set_accepted()

    def ignore(self) -> None:
        """Leave it without a status."""

    def reject(self, text: str, /, **fields: Any) -> None:
        self.handle.set_rejected(self._result(fields), text)

    def succeed(self, text: str = "", /, **fields: Any) -> None:
        self.handle.set_succeeded(self._result(fields), text)

    def abort(self, text: str, /, **fields: Any) -> None:
        self.handle.set_aborted(self._result(fields), text)

    def cancel(self, text: str, /, **fields: Any) -> None:
        self.handle.set_canceled(self._result(fields), text)

    def feedback(self, **fields: Any) -> None:
        self.handle.publish_feedback(message_class(f"{self.kind}Feedback")(**fields))

    def _result(self, fields: dict[str, Any]) -> Any:
        return message_class(f"{self.kind}Result")(**fields)


class ActionGoals:
    """`robots.simulator.ros_side.Goals` of an actionlib server."""

    def __init__(self, action: str, kind: str) -> None:
        self._kind = kind
        self._arrived: queue.SimpleQueue[tuple[bool, Any]] = queue.SimpleQueue()
        self._server = ActionServer(
            action,
            message_class(f"{kind}Action"),
            goal_cb=lambda handle: self._arrived.put((True, handle)),
            cancel_cb=lambda handle: self._arrived.put((False, handle)),
            auto_start=False,
        )
        self._server.start()

    def arrived(self) -> Iterator[tuple[bool, ActionGoal]]:
        while not self._arrived.empty():
            is_new, handle = self._arrived.get()
            if is_new and handle.get_goal_status().status == GoalStatus.RECALLING:
                handle.set_canceled(text="cancelled before it was begun")
            else:
                yield is_new, ActionGoal(handle, self._kind)
