"""Requests that are carried out, and over, as soon as they are recorded."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from robots.bridge.audit.records import RecordedTask, Requester, pop_due
from robots.bridge.tasks.task import Activity, Cause, Context, Ending, Reaction, TaskPart
from robots.shared import wire
from robots.shared.records.record_sink import Parameters
from robots.shared.wire import Grant, Refusal, TaskKind


class Asked:
    """Requests of one kind that wait for their record. `why_not`: the extra rules of this kind."""

    def __init__(self, kind: TaskKind, context: Context, why_not: Callable[[float], Refusal | None]) -> None:
        self._kind = kind
        self._records = context.records
        self._rules = context.rules
        self._why_not = why_not
        self._waiting: list[RecordedTask] = []

    def ask(self, requester: Requester, now_s: float, parameters: Parameters | None = None) -> bool:
        """Record a request, or refuse it. Return whether it is being recorded."""
        refusal = self._rules.why_not_begin(requester, now_s) or self._why_not(now_s)
        if refusal is not None:
            requester.answer(refusal)
            return False
        number = self._records.request(requester.holder, self._kind.record, parameters or {}, now_s)
        self._waiting.append(RecordedTask(requester, number, now_s))
        return True

    def granted(self, now_s: float, barred: Refusal | None = None) -> bool:
        """Answer recorded requests. Return whether one of them may be carried out.

        `barred`: a refusal that holds for all of them.
        """
        granted = False
        for asked in pop_due(self._waiting):
            refusal = asked.unrecorded or self._rules.why_not_begin(asked.requester, now_s)
            refusal = refusal or self._why_not(now_s) or barred
            granted = granted or refusal is None
            self._answer(asked, refusal, now_s)
        return granted

    def deny(self, refusal: Refusal, now_s: float) -> None:
        """Refuse all requests that are not recorded yet."""
        denied, self._waiting = self._waiting, []
        for asked in denied:
            self._answer(asked, refusal, now_s)

    def __bool__(self) -> bool:
        return bool(self._waiting)

    def _answer(self, asked: RecordedTask, refusal: Refusal | None, now_s: float) -> None:
        """Answer the requester and record the result."""
        asked.requester.answer(refusal)
        outcome = refusal.code if refusal else "sent"
        self._records.outcome(asked, self._kind.outcome, outcome, {}, now_s)


class AtOnce(TaskPart):
    """A part without tasks that last: only requests that wait for their record can end."""

    reactions = {
        Cause.CANCELLED: Reaction.GO_ON,
        Cause.SUPERSEDED: Reaction.GO_ON,
        Cause.GATE: Reaction.GO_ON,
        Cause.HALTED: Reaction.GO_ON,
        Cause.ROBOT_GONE: Reaction.GO_ON,
        Cause.STOPPED: Reaction.DROP,
        Cause.CONTROL_ENDED: Reaction.DROP,
        Cause.PAGE_LEFT: Reaction.DROP,
        Cause.LINK_LOST: Reaction.GO_ON,
        Cause.UNRECORDED: Reaction.DROP,
        Cause.BRIDGE_ENDED: Reaction.DROP,
    }

    def end_running(self, ending: Ending, now_s: float) -> None:
        """Do nothing: none of these tasks runs."""


class Memory(AtOnce):
    """The gate’s memory of obstacles, which its holder may clear while base and arm stand."""

    kinds = (wire.FORGET,)

    def __init__(self, context: Context) -> None:
        self._context = context
        self._asked = Asked(wire.FORGET, context, self._why_not)

    def take(self, order: Any, grant: Grant, requester: Requester, now_s: float) -> None:
        self._asked.ask(requester, now_s)

    def drop(self, ending: Ending, now_s: float) -> None:
        self._asked.deny(ending.of_unbegun, now_s)

    def tick(self, now_s: float) -> None:
        if self._asked.granted(now_s):
            self._context.gate.forget()

    def _why_not(self, now_s: float) -> Refusal | None:
        """Return a refusal if the gate needs its memory: the base or the arm moves."""
        blocked = self._context.tasks.blocks(Activity.FORGET, now_s)
        return blocked or self._context.rules.why_not_still(now_s)
