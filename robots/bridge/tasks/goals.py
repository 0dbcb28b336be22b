"""One goal of the robot at a time: recorded, sent, observed, cancelled until the robot obeys, ended.

No goal begins by itself. A cancelled goal is not sent again: the person must make a new request.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import ClassVar, Generic, TypeVar
from uuid import uuid4

from msgspec import structs

from robots.bridge.audit.records import RecordedTask, Records, Requester
from robots.bridge.tasks.task import Cause, Ending
from robots.bridge.watchdog.rules import CANCEL_AGAIN_S
from robots.shared.sentences import say
from robots.shared.wire import GOAL_PREFIX, Refusal

UNHEARD_S = 2.0  # a goal that the robot has not reported for this time is given up
OURS = GOAL_PREFIX  # goal ids of this bridge and of earlier bridges begin with it

What = TypeVar("What")


@dataclass(eq=False)
class Goal(RecordedTask, Generic[What]):
    """A requested goal; it has an id when it is sent."""

    what: What
    topic: str  # the action's name, for an action
    id: str | None = None
    heard_s: float = math.inf  # when it was recorded, sent, or last reported by the robot
    reported: bool = False  # the robot has it
    cancelled: Refusal | None = None  # reason of the cancel; its code is the outcome
    cancel_sent_s: float | None = None  # the last cancel was sent at this time or earlier

    def sent(self, now_s: float) -> str:
        """Note that the goal is sent to the robot now. Return its new id."""
        self.id, self.heard_s = f"{OURS}{self.number.result()}-{uuid4()}", now_s
        return self.id


class Goals(ABC, Generic[What]):
    """This console's goal in progress, and goals of other nodes, of which only ids are known.

    `send_cancel(goal_id, topic)` cancels a goal on the robot.
    """

    # this kind's words for a cause, in place of the refusal's code
    outcomes: ClassVar[Mapping[Cause, str]] = {}
    # a goal that was sent is given up if the robot has not reported it at all for this time
    answered_within_s: ClassVar[float] = UNHEARD_S

    def __init__(self, records: Records, send_cancel: Callable[[str, str], None]) -> None:
        self._records = records
        self._send_cancel = send_cancel
        self._current: Goal[What] | None = None
        self._ended: str | None = None  # the last goal; late reports about it may still arrive
        self._others: dict[str, float] = {}  # topics with goals of other nodes, with their last report

    @property
    def topic(self) -> str | None:
        """Topic of this console's goal."""
        return self._current.topic if self._current else None

    def cancel(self, outcome: str, why: str) -> bool:
        """Cancel this console's goal by its id. Return whether there was one."""
        goal = self._current
        if goal is None:
            return False
        if goal.cancelled is None:
            goal.cancelled = Refusal(outcome, why, "robot")
            if goal.id is not None:
                self._send_cancel(goal.id, goal.topic)
        return True

    @property
    def in_progress(self) -> bool:
        """Return whether this console's goal is requested or sent, and has not ended."""
        return self._current is not None

    @property
    def begun(self) -> bool:
        """Return whether this console's goal was sent and has not ended."""
        return self._current is not None and self._current.id is not None

    @property
    def waiting(self) -> Requester | None:
        """The requester of a goal that is neither sent nor cancelled."""
        goal = self._current
        return goal.requester if goal is not None and goal.id is None and goal.cancelled is None else None

    def deny(self, refusal: Refusal, now_s: float) -> None:
        """Refuse a goal that is not sent yet. If it was cancelled before, use the reason of the cancel."""
        goal = self._current
        if goal is None or goal.id is not None:
            return
        refusal = goal.cancelled or refusal
        if math.isinf(goal.heard_s):
            self._current = None
            goal.requester.answer(refusal)
            self._record(goal, refusal.code, refusal.sentence, now_s)
        else:  # the answer was already sent
            self._end(refusal.code, refusal.sentence, now_s)

    def drop(self, ending: Ending, now_s: float) -> None:
        """Refuse a goal that is not sent yet."""
        self.deny(self._worded(ending), now_s)

    def end_running(self, ending: Ending, now_s: float) -> None:
        """Cancel a goal that was sent. It ends when the robot obeys."""
        if self.begun:
            refusal = self._worded(ending)
            self.cancel(refusal.code, refusal.sentence)

    def leave(self, ending: Ending, now_s: float) -> None:
        """Cancel a goal that was sent, and record its end now: the bridge ends."""
        self.end_running(ending, now_s)
        self._end("cancelled", "", now_s)

    def _worded(self, ending: Ending) -> Refusal:
        code = self.outcomes.get(ending.cause, ending.refusal.code)
        return structs.replace(ending.refusal, code=code)

    def ended(self, goal_id: str, outcome: str, text: str, now_s: float) -> None:
        """Take the robot's report that a goal has ended."""
        if self._current is not None and self._current.id == goal_id:
            self._end(outcome, text, now_s)

    def tick(self, now_s: float) -> None:
        """Repeat a cancel until the robot obeys; give up a goal that the robot no longer reports."""
        goal = self._current
        if goal is None:
            return
        limit_s = self.answered_within_s if goal.id is not None and not goal.reported else UNHEARD_S
        if now_s - goal.heard_s > limit_s:
            self.cancel("unheard", say("The robot did not report it for {seconds:.0f} s.", seconds=limit_s))
            self._end("cancelled", "", now_s)
            self._ended = None  # a later report means that the robot still performs this goal
        elif goal.cancelled is not None and goal.id is not None:
            if goal.cancel_sent_s is None:
                goal.cancel_sent_s = now_s
            elif now_s - goal.cancel_sent_s >= CANCEL_AGAIN_S:
                goal.cancel_sent_s = now_s
                self._send_cancel(goal.id, goal.topic)

    def _busy(self, now_s: float) -> set[str]:
        """Return topics on which the robot performs goals of other nodes."""
        return {topic for topic, heard_s in self._others.items() if now_s - heard_s <= UNHEARD_S}

    def _once_recorded(self, now_s: float) -> Goal[What] | None:
        """Return a recorded goal that waits to be sent.

        If its record failed or if it was cancelled, end it and return None.
        """
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

    def _find_own(self, topic: str, ids: Collection[str], now_s: float) -> Goal[What] | None:
        """Take the robot's report of active goals on a topic. Return this console's goal if it is among them."""
        goal = self._current
        if set(ids) - {goal.id if goal else None, self._ended}:
            self._others[topic] = now_s
        else:
            self._others.pop(topic, None)
        if goal is None or goal.id not in ids:
            return None
        goal.heard_s, goal.reported = now_s, True
        return goal

    def _end(self, outcome: str, text: str, now_s: float) -> None:
        """End the goal. For the outcome "cancelled", use the reason of our own cancel, if there was one."""
        goal, self._current = self._current, None
        if goal is not None:
            self._ended = goal.id
            if outcome == "cancelled" and goal.cancelled is not None:
                outcome, text = goal.cancelled.code, goal.cancelled.sentence
            self._report_end(goal, outcome, text)
            self._record(goal, outcome, text, now_s)

    @abstractmethod
    def _report_end(self, goal: Goal[What], outcome: str, text: str) -> None:
        """Report to pages how the goal ended."""

    @abstractmethod
    def _record(self, goal: Goal[What], outcome: str, text: str, now_s: float) -> None:
        """Record how the goal ended, or that it never began."""
