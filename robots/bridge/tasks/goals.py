"""One goal at a time: record it, send it, follow it, cancel it until the robot obeys.

No goal starts by itself, and a cancelled goal never starts again.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Generic, TypeVar
from uuid import uuid4

from robots.bridge.audit.records import RecordedTask, Records, Requester
from robots.wire import Refusal

CANCEL_AGAIN_S = 0.5  # a cancel that the robot does not obey may not have reached it
UNHEARD_S = 2.0  # a goal that the robot has not spoken of for this long is given up
# How ids begin, of this bridge and of those before it; the number of the record follows.
OURS = "fleet_bridge-"

What = TypeVar("What")


@dataclass(eq=False)
class Goal(RecordedTask, Generic[What]):
    """Something that was asked for; it has an id once it is sent."""

    what: What
    topic: str  # an action's name, if an action performs it
    id: str | None = None
    heard_s: float = math.inf  # when it was on record, was sent, or the robot spoke of it
    cancelled: Refusal | None = None  # why; its code is the outcome
    cancel_sent_s: float | None = None  # no later than this

    def sent(self, now_s: float) -> str:
        """It goes to the robot now, by this id."""
        self.id, self.heard_s = f"{OURS}{self.number.result()}-{uuid4()}", now_s
        return self.id


class Goals(ABC, Generic[What]):
    """The goal under way, if any: this console's own, or somebody else's, of which only ids are known.

    `withdraw` has the robot cancel the goal of an id, on a topic.
    """

    def __init__(self, records: Records, withdraw: Callable[[str, str], None]) -> None:
        self._records = records
        self._withdraw = withdraw
        self._current: Goal[What] | None = None
        self._ended: str | None = None  # the last one, of which an older word may still come
        self._others: dict[str, float] = {}  # topics on which others have the robot do something: told last

    @property
    def topic(self) -> str | None:
        """Where this console's goal is performed."""
        return self._current.topic if self._current else None

    def cancel(self, outcome: str, why: str) -> bool:
        """Cancel this console's goal by its id. Whether there was one."""
        goal = self._current
        if goal is None:
            return False
        if goal.cancelled is None:
            goal.cancelled = Refusal(outcome, why, "robot")
            if goal.id is not None:
                self._withdraw(goal.id, goal.topic)
        return True

    @property
    def begun(self) -> bool:
        """Whether this console's goal was sent to the robot, and has not ended."""
        return self._current is not None and self._current.id is not None

    @property
    def waiting(self) -> Requester | None:
        """Requesters of goals that are neither sent nor cancelled."""
        goal = self._current
        return goal.requester if goal is not None and goal.id is None and goal.cancelled is None else None

    def deny(self, refusal: Refusal, now_s: float) -> None:
        """Deny all goals that are not sent, for this reason or for their earlier cancel reason."""
        goal = self._current
        if goal is None or goal.id is not None:
            return
        refusal = goal.cancelled or refusal
        if math.isinf(goal.heard_s):
            self._current = None
            goal.requester.answer(refusal)
            self._record(goal, refusal.code, refusal.text, now_s)
        else:  # that it is done was the answer already
            self._end(refusal.code, refusal.text, now_s)

    def ended(self, goal_id: str, outcome: str, text: str, now_s: float) -> None:
        """The robot says that a goal has ended."""
        if self._current is not None and self._current.id == goal_id:
            self._end(outcome, text, now_s)

    def tick(self, now_s: float) -> None:
        """Repeat a cancel until the robot obeys; give up a goal of which it does not speak any more."""
        goal = self._current
        if goal is None:
            return
        if now_s - goal.heard_s > UNHEARD_S:
            self.cancel("unheard", f"The robot did not speak of it for {UNHEARD_S:.0f} s.")
            self._end("cancelled", "", now_s)
            self._ended = None  # if the robot speaks of it again, it does it
        elif goal.cancelled is not None and goal.id is not None:
            if goal.cancel_sent_s is None:
                goal.cancel_sent_s = now_s
            elif now_s - goal.cancel_sent_s >= CANCEL_AGAIN_S:
                goal.cancel_sent_s = now_s
                self._withdraw(goal.id, goal.topic)

    def _busy(self, now_s: float) -> set[str]:
        """The topics on which the robot does what others asked for."""
        return {topic for topic, told_s in self._others.items() if now_s - told_s <= UNHEARD_S}

    def _recorded(self, now_s: float) -> Goal[What] | None:
        """Goals that are recorded and ready to send. Goals without a record, or cancelled ones, end here."""
        goal = self._current
        if goal is None or goal.id is not None or not goal.number.done():
            return None
        if refusal := goal.unrecorded or goal.cancelled:
            self.deny(refusal, now_s)
            return None
        if math.isinf(goal.heard_s):
            goal.heard_s = now_s
            goal.requester.answer(None)
        return goal

    def _heard(self, topic: str, ids: Collection[str], now_s: float) -> Goal[What] | None:
        """The robot says which goals are under way on a topic. This console's, if it is one of them."""
        goal = self._current
        if set(ids) - {goal.id if goal else None, self._ended}:
            self._others[topic] = now_s
        else:
            self._others.pop(topic, None)
        if goal is None or goal.id not in ids:
            return None
        goal.heard_s = now_s
        return goal

    def _end(self, outcome: str, text: str, now_s: float) -> None:
        """If a goal ended as cancelled and this console cancelled it, use this console's reason."""
        goal, self._current = self._current, None
        if goal is not None:
            self._ended = goal.id
            if outcome == "cancelled" and goal.cancelled is not None:
                outcome, text = goal.cancelled.code, goal.cancelled.text
            self._tell(goal, outcome, text)
            self._record(goal, outcome, text, now_s)

    @abstractmethod
    def _tell(self, goal: Goal[What], outcome: str, text: str) -> None:
        """Tell pages how it ended."""

    @abstractmethod
    def _record(self, goal: Goal[What], outcome: str, text: str, now_s: float) -> None:
        """Put on record how it ended, or that it never began."""
