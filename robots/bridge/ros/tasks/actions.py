"""One action of the robot, used by its topics. Goals have our own ids, so that we can cancel only these."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

import rospy
from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray

from robots.bridge.ros.bounds.listening import pause
from robots.bridge.ros.tasks.publishing import Sender, heard_by, publish
from robots.bridge.tasks.goals import OURS
from robots.shared.configuration.bridge_config import Topic
from robots.shared.ros.message_types.classes import message_class
from robots.shared.texts import NAME, SENTENCE, cut, most_of

STATUS_RESTS_S = 0.4  # between reads of statuses while nobody has control
RUNNING = (GoalStatus.PENDING, GoalStatus.ACTIVE, GoalStatus.PREEMPTING, GoalStatus.RECALLING)
OUTCOMES = {  # others: "failed"
    GoalStatus.SUCCEEDED: "succeeded",
    GoalStatus.PREEMPTED: "cancelled",
    GoalStatus.RECALLED: "cancelled",
    GoalStatus.REJECTED: "rejected",
}


class GoalListener(ABC):
    """Receiver of an action's reports, on rospy's threads."""

    @abstractmethod
    def running(self, action: str, goals: dict[str, int]) -> None:
        """Take the running goals of all senders, and their status."""

    def feedback(self, goal_id: str, feedback: Any) -> None:  # noqa: B027  (not every action's is of use)
        """Take feedback of the action."""

    @abstractmethod
    def ended(self, goal_id: str, outcome: str, text: str, result: Any) -> None:
        """Take the end of a goal: one of `OUTCOMES`, or "failed"."""


class ActionTopics:
    """The topics of one action. `joined` is called whenever a node subscribes to its goals."""

    def __init__(
        self, action: Topic, listener: GoalListener, joined: Callable[[], None] = lambda: None
    ) -> None:
        kind = action.type.removesuffix("Action")
        self.name = action.name
        self.goal_class = message_class(f"{kind}ActionGoal")
        self._listener = listener
        self._goals = Sender(f"{action.name}/goal", self.goal_class, joined)
        self._cancels = Sender(f"{action.name}/cancel", GoalID)
        self._goal_id: str | None = None  # the last goal sent
        listeners = {
            "status": (GoalStatusArray, self._on_status, 1),
            "feedback": (message_class(f"{kind}ActionFeedback"), self._on_feedback, 10),
            "result": (message_class(f"{kind}ActionResult"), self._on_result, 10),
        }
        pause(f"{action.name}/status", lambda: STATUS_RESTS_S, hurried_s=0.0)
        self._subscribers = [
            rospy.Subscriber(f"{action.name}/{part}", type_, listener, queue_size=size, tcp_nodelay=True)
            for part, (type_, listener, size) in listeners.items()
        ]

    def send(self, goal: Any) -> None:
        """Send a goal whose id is set."""
        self._goal_id = goal.goal_id.id
        self._goals.send(goal)

    @property
    def heard(self) -> bool:
        """Return whether a node of the robot listens to goals."""
        return bool(heard_by(self._goals.publisher))

    def cancel(self, goal_id: str) -> None:
        """Cancel this goal and no other."""
        if goal_id == self._goal_id:
            self._goals.withdraw()
        self._cancels.send(GoalID(id=goal_id))

    def cancel_all(self) -> None:
        """Cancel the goals of all clients, as an emergency stop must."""
        self._goals.withdraw()
        publish(self._cancels.publisher, GoalID())

    def close(self) -> None:
        """Unregister from the action's topics."""
        self._goals.close()
        self._cancels.close()
        for subscriber in self._subscribers:
            subscriber.unregister()

    # --- on rospy's threads ------------------------------------------------------------------------

    def _on_status(self, message: Any) -> None:
        goals = {
            status.goal_id.id: status.status for status in message.status_list if status.status in RUNNING
        }
        self._listener.running(self.name, most_of(goals, OURS))

    def _on_feedback(self, message: Any) -> None:
        self._listener.feedback(cut(message.status.goal_id.id, NAME), message.feedback)

    def _on_result(self, message: Any) -> None:
        self._listener.ended(*ended(message), message.result)


def ended(message: Any) -> tuple[str, str, str]:
    """Return the id of a goal that has ended, its outcome and the action's text, by the message of its result."""
    status = message.status
    return cut(status.goal_id.id, NAME), OUTCOMES.get(status.status, "failed"), cut(status.text, SENTENCE)
