"""Records of a bridge: requests before they are carried out, outcomes, stops, the map.

The sink commits them on one worker thread, in order. The control loop checks for completion and never waits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, TypeVar

from robots.bridge.audit.record_sink import Holder, Parameters, RecordSink, TakenMap
from robots.bridge.audit.record_writer import RecordWriter
from robots.wire import Refusal

Reply = Callable[[Refusal | None], None]  # to what was asked: why not, or None once it is on its way


class Requester(NamedTuple):
    """The person who requested a task, their link, and the callback for the answer."""

    holder: Holder
    link: int
    answer: Reply


@dataclass(eq=False)
class RecordedTask:
    """Something that was asked for, and since when; it is done once it is on record, and then has a number there."""

    requester: Requester
    number: Future[int]
    since_s: float

    @property
    def unrecorded(self) -> Refusal | None:
        """Of what is no longer being put on record: why it could not be."""
        error = self.number.exception()
        if error is None:
            return None
        return Refusal("not_recorded", f"It was not done, for it cannot be recorded ({error}).", "audit")


A = TypeVar("A", bound=RecordedTask)


def pop_due(waiting: list[A]) -> list[A]:
    """Take out of `waiting` what is on record by now, or cannot be."""
    due = [asked for asked in waiting if asked.number.done()]
    waiting[:] = [asked for asked in waiting if asked not in due]
    return due


class Records(RecordWriter):
    """The records of one bridge."""

    def __init__(self, sink: RecordSink) -> None:
        super().__init__(sink.pulse)
        self.sink = sink

    def open(self, on_done: Callable[[], object], now_s: float) -> None:
        """Before anything is asked for. `on_done` is called on the worker's thread once what was asked for is done."""
        self.on_done = on_done
        self.keep(self.sink.settle, now_s)

    def request(self, holder: Holder, kind: str, parameters: Parameters, now_s: float) -> Future[int]:
        """Put on record what is asked of the robot besides driving; its number, once it is committed."""
        return self.ask(lambda: self.sink.request(holder, kind, parameters), now_s)

    def outcome(
        self, asked: RecordedTask, kind: str, outcome: str, parameters: Parameters, now_s: float
    ) -> None:
        """Put on record what came of it; of what is not on record itself nothing came."""
        number, holder = asked.number, asked.requester.holder
        self.keep(
            lambda: self.sink.outcome(number.result(), holder, kind, outcome, parameters), now_s, of=number
        )

    def cancelled(self, topic: str, goal: str, now_s: float) -> Future[int]:
        """Put on record that the bridge itself cancels a motion's goal: only afterwards, as it does so for safety."""
        what = {"topic": topic, "goal": goal}
        return self.keep(lambda: self.sink.request(None, "motion.cancel", what), now_s)

    def was_cancelled(self, cancel: Future[int], outcome: str, now_s: float) -> None:
        """Put on record what came of that."""
        self.keep(
            lambda: self.sink.outcome(cancel.result(), None, "motion.cancel", outcome, {}), now_s, of=cancel
        )

    def stopped(self, holder: Holder | None, number: int, was_standing: bool, now_s: float) -> None:
        """Put on record that the robot was stopped, if only afterwards: a stop waits for nothing."""
        self.keep(lambda: self.sink.stopped(holder, number, was_standing), now_s)

    def keep_map(self, taken: TakenMap) -> None:
        """Keep the robot's map, between two records."""
        self.aside(partial(self.sink.keep_map, taken))


def unrecorded(why: str, ended: Sequence[str] = ()) -> Refusal:
    """Why the robot stands. `ended`: what else was under way, in words."""
    text = f"The robot stands still: what it does cannot be recorded ({why})."
    if ended:
        text += f" Ended: {', '.join(ended)}."
    return Refusal("not_recorded", text, "audit")
