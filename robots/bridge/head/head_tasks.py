"""Requests to turn the head and to look ahead; and where the head looks meanwhile."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

from robots.bridge.audit.records import Requester
from robots.bridge.head.head import Aim, Head
from robots.bridge.head.turning import Result, Turning, reported
from robots.bridge.navigation.navigation_goals import NavigationGoals
from robots.bridge.tasks.at_once import Asked, AtOnce
from robots.bridge.tasks.task import Activity, Context, Ending
from robots.shared import wire
from robots.shared.geometry.poses import STILL
from robots.shared.sentences import say
from robots.shared.wire import Grant, Refusal

TURNS_S = 10.0  # turns of the head with shorter pauses have one record together
MOST_TURNS = 20  # turns of the head that may wait for their record

_REPLACED = Result("replaced", say("A new request replaced it."))


class HeadMover(ABC):
    """The robot's head."""

    @abstractmethod
    def aim_head(self, aim: Aim) -> str | None:
        """Send the head to this aim. Return the goal's id if the robot's action carries it out; it tells the end."""

    @abstractmethod
    def head_at(self) -> tuple[float, float] | None:
        """Return pan and tilt of the head (radians) by its joint states; None if they are unknown."""


class HeadTasks(AtOnce):
    kinds = (wire.LOOK_AHEAD, wire.TURN_HEAD)

    def __init__(self, context: Context) -> None:
        source = context.config.topics.head
        self._context = context
        self._head = Head(source) if source else None
        self._looks = Asked(wire.LOOK_AHEAD, context, self._why_not)
        self._turns = Asked(wire.TURN_HEAD, context, self._why_not)
        self._asked_turns: list[wire.TurnHead] = []  # turns that wait for their record
        # Fence of the recorded turns, and until when further turns need no new record.
        self._recorded: tuple[int, float] = (0, float("-inf"))
        self._turning: Turning | None = None
        self._followed: int | None = None  # fence of the control in which the head last turned by itself

    def take(self, order: Any, grant: Grant, requester: Requester, now_s: float) -> None:
        """Record the request, or carry it out with a turn that is recorded."""
        if isinstance(order, wire.TurnHead):
            self._turn(order, requester, now_s)
        else:
            self._looks.ask(requester, now_s)

    def drop(self, ending: Ending, now_s: float) -> None:
        """Refuse requests that are not recorded yet, and drop the remaining steps of looking ahead.

        A turn on its way ends: nobody watches it any more.
        """
        self._asked_turns.clear()
        self._end(Result(ending.refusal.code, ending.refusal.sentence))
        if self._head is not None:
            self._head.stay()
        self._looks.deny(ending.of_unbegun, now_s)
        self._turns.deny(ending.of_unbegun, now_s)

    def tick(self, now_s: float) -> None:
        """Move the head: down and ahead after a recorded request; ahead for a drive to a place; else into the turn.

        If a rule forbids a later step of looking ahead, the head stays down, and the gate limits the speed.
        """
        mover = self._context.robot.part(HeadMover)
        aim = None if self._head is None else self._next_aim(self._head, now_s)
        if aim is not None and mover is not None:
            self._end(_REPLACED)
            mover.aim_head(aim)
        if self._turning is not None and mover is not None:
            self._end(self._turning.look(mover.head_at(), now_s))

    def ended(self, goal: str, outcome: str, text: str) -> None:
        """Take the report of the robot's action that a goal has ended."""
        if self._turning is not None and self._turning.goal == goal:
            self._end(reported(outcome, text))

    def _next_aim(self, head: Head, now_s: float) -> Aim | None:
        rules, navigation = self._context.rules, self._context.tasks.part(NavigationGoals)
        if self._looks.granted(now_s):
            return head.ahead(self._context.gate.look_to(now_s), now_s)
        if self._turns.granted(now_s):
            self._begin_turns(head, now_s)
            return None
        if navigation.driving_requester or navigation.due:
            return head.forward(now_s)  # the gate's camera looks where it drives
        if (onward := head.onward(now_s)) is not None:
            return onward if self._why_not(now_s) is None else None
        if rules.lease.current and rules.sent != STILL and self._why_not(now_s) is None:
            aim = head.follow(rules.sent, now_s)
            self._followed = rules.lease.current.fence if aim else self._followed
            return aim
        return None

    def state(self, now_s: float) -> dict[str, Any]:
        """Return the last end of a turn; and whether the head turned by itself: the driver did not ask for it."""
        grant = self._context.rules.lease.current
        return {
            "head_ended": self.last,
            "head_follows": grant is not None and grant.fence == self._followed,
        }

    def headline(self, now_s: float) -> tuple[object, ...]:
        """Return the last end, unless another turn followed: a drag consists of many."""
        return (self.last if self.last and self.last.outcome != _REPLACED.outcome else None,)

    def _why_not(self, now_s: float) -> Refusal | None:
        if self._head is None:
            return Refusal("no_head", "This robot has no head that can be turned.", "robot")
        return self._context.rules.why_closed(now_s) or self._context.tasks.blocks(Activity.TURN_HEAD, now_s)

    def _turn(self, order: wire.TurnHead, requester: Requester, now_s: float) -> None:
        """Turn the head. A drag in the camera's picture causes many turns: only the first is recorded."""
        (fence, until_s), mover = self._recorded, self._context.robot.part(HeadMover)
        if self._head is None or mover is None or order.fence != fence or now_s > until_s:
            if self._turns.ask(requester, now_s):
                self._asked_turns = [*self._asked_turns[-MOST_TURNS:], order]
            return
        refusal = self._context.rules.why_not_begin(requester, now_s) or self._why_not(now_s)
        requester.answer(refusal)
        if refusal is None:
            self._begin(self._head, mover, [order], now_s)

    def _begin_turns(self, head: Head, now_s: float) -> None:
        """Begin turns that were recorded just now."""
        turns, self._asked_turns = self._asked_turns, []
        if turns and (mover := self._context.robot.part(HeadMover)):
            self._begin(head, mover, turns, now_s)

    def _begin(self, head: Head, mover: HeadMover, turns: list[wire.TurnHead], now_s: float) -> None:
        """Do turns at once, as one."""
        first = max((n for n, turn in enumerate(turns) if turn.absolute or turn.here), default=0)
        pan, tilt = sum(turn.pan for turn in turns[first:]), sum(turn.tilt for turn in turns[first:])
        absolute, here = turns[first].absolute, turns[first].here
        aim = head.turn(pan, tilt, mover.head_at(), now_s, absolute=absolute, here=here)
        self._recorded = turns[-1].fence, now_s + TURNS_S
        self._end(_REPLACED)
        self._turning = Turning(turns[-1], aim, mover.aim_head(aim), now_s)

    def _end(self, result: Result | None) -> None:
        """End the turn on its way, if there is one, with this result; None: it goes on."""
        if result is not None and self._turning is not None:
            order, self._turning = self._turning.order, None
            self.last = wire.HeadEnd(order.seq, order.fence, *result)
