"""Records of the bridge: requests before they are carried out, their outcomes, stops, the robot's map.

The sink commits them in one worker thread, in order; the control loop polls and never waits.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, TypeVar
from uuid import UUID

import msgspec

from robots.bridge.audit.record_writer import RecordWriter
from robots.shared.records.record_sink import (
    FileChange,
    FileCut,
    Holder,
    Parameters,
    RecordError,
    RecordSink,
    TakenDescription,
    TakenMap,
    TakenRecording,
)
from robots.shared.sentences import joined, say
from robots.shared.wire import Refusal

log = logging.getLogger(__name__)

Reply = Callable[[Refusal | None], None]  # answers a request: with a refusal, or None if it is accepted


class Requester(NamedTuple):
    """The person who requests a task, the link, and the reply."""

    holder: Holder
    link: int
    answer: Reply


@dataclass(eq=False)
class RecordedTask:
    """A requested task and its time. It may begin when it is recorded: then `number` is known."""

    requester: Requester
    number: Future[int]
    since_s: float

    @property
    def unrecorded(self) -> Refusal | None:
        """The refusal if its record failed, else None."""
        error = self.number.exception()
        if error is None:
            return None
        text = say("It was not done because it cannot be recorded ({error}).", error=error)
        return Refusal("not_recorded", text, "audit")


A = TypeVar("A", bound=RecordedTask)


def pop_due(waiting: list[A]) -> list[A]:
    """Return and remove from `waiting` the tasks whose record is written, or could not be written."""
    due = [asked for asked in waiting if asked.number.done()]
    waiting[:] = [asked for asked in waiting if asked not in due]
    return due


class Records(RecordWriter):
    """The records of one bridge."""

    def __init__(self, sink: RecordSink) -> None:
        super().__init__(sink.test_writable)
        self.sink = sink

    def open(self, on_done: Callable[[], object], now_s: float) -> None:
        """Start, before any request. `on_done` is called on the worker's thread after each request."""
        self.on_done = on_done
        self.keep(self.sink.settle, now_s)

    def request(self, holder: Holder, kind: str, parameters: Parameters, now_s: float) -> Future[int]:
        """Record a request of a task; the result is its number when it is committed."""
        return self.ask(lambda: self.sink.request(holder, kind, parameters), now_s)

    def outcome(
        self, asked: RecordedTask, kind: str, outcome: str, parameters: Parameters, now_s: float
    ) -> None:
        """Record the outcome of a request. A request that is not recorded has no outcome."""
        number, holder = asked.number, asked.requester.holder
        self.keep(
            lambda: self.sink.outcome(number.result(), holder, kind, outcome, parameters), now_s, of=number
        )

    def own(self, kind: str, what: Parameters, now_s: float) -> Future[int]:
        """Record what the bridge itself does or notices. The record follows it: safety comes first."""
        return self.keep(lambda: self.sink.request(None, kind, what), now_s)

    def own_outcome(
        self, own: Future[int], kind: str, outcome: str, parameters: Parameters, now_s: float
    ) -> None:
        """Record the outcome of that."""
        self.keep(lambda: self.sink.outcome(own.result(), None, kind, outcome, parameters), now_s, of=own)

    def record_stop(self, holder: Holder | None, number: int, was_standing: bool, now_s: float) -> None:
        """Record that the robot was stopped. The record follows the stop: a stop waits for nothing."""
        self.keep(lambda: self.sink.stopped(holder, number, was_standing), now_s)

    def keep_map(self, taken: TakenMap) -> None:
        """Store the robot's map between two records."""
        self.run_in_background(partial(self.sink.keep_map, taken))

    def keep_recording(self, taken: TakenRecording, done: Callable[[bool], object]) -> None:
        """Store the row of a recording between two records. `done` hears, on the worker's thread, whether it is."""

        def keep() -> None:
            try:
                self.sink.keep_recording(taken)
            except RecordError as error:
                log.warning("a recording's row is stored later: %s", error)
                done(False)
            except Exception:
                done(False)
                raise
            else:
                done(True)

        self.run_in_background(keep)

    def drop_recording(self, recording: UUID) -> None:
        """Store that the file of a recording is gone."""
        self.run_in_background(partial(self.sink.drop_recording, recording))

    def recording_changes(
        self, after: UUID | None, found: Callable[[list[tuple[UUID, FileChange]]], object]
    ) -> None:
        """Ask what must be done with finished files. `found` is called on the worker's thread."""

        def ask() -> None:
            try:
                changes = self.sink.recording_changes(after)
            except RecordError:
                return  # the database does not answer: the next time
            found([(UUID(recording), change) for recording, change in changes])

        self.run_in_background(ask)

    def recording_changed(self, recording: UUID, change: FileChange) -> None:
        """Store that this was done."""
        self.run_in_background(partial(self.sink.recording_changed, recording, change))

    def recording_cuts(self, after: UUID | None, found: Callable[[list[FileCut]], object]) -> None:
        """Ask which files must lose people who were erased. `found` is called on the worker's thread."""

        def ask() -> None:
            try:
                cuts = self.sink.recording_cuts(after)
            except RecordError:
                return  # the database does not answer: the next time
            found(msgspec.convert(cuts, list[FileCut]))

        self.run_in_background(ask)

    def recording_cut(self, done: FileCut) -> None:
        """Store that a file has lost them."""
        self.run_in_background(partial(self.sink.recording_cut, done))

    def keep_description(self, taken: TakenDescription, failed: Callable[[], object]) -> None:
        """Store the robot's description between two records. `failed` is called on the worker's thread."""

        def keep() -> None:
            try:
                self.sink.keep_description(taken)
            except Exception:
                failed()
                raise

        self.run_in_background(keep)


def unrecorded(why: str, ended: Sequence[str] = ()) -> Refusal:
    """Return the refusal while records cannot be written. `ended`: tasks that ended for this, in words."""
    text = say("The robot stands still because its actions cannot be recorded ({why}).", why=why)
    if ended:
        text = say("{stands} Ended: {tasks}.", stands=text, tasks=joined(", ", ended))
    return Refusal("not_recorded", text, "audit")
