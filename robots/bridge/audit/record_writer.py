"""Write records on one worker thread, in order, while the control loop continues.

A request must be written before it is carried out: if writing fails, it is refused and dropped. An event must
be written sooner or later: it is kept, and tried again before all later records. Until then no request
succeeds, so only the ends of work in progress are kept. Callers must limit events that the robot causes by
itself. While the robot drives, a test every half second shows whether the database can be written.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeVar

from robots.shared.records.record_sink import BadRecord, RecordError
from robots.shared.sentences import reason_of, say

log = logging.getLogger(__name__)

PULSE_S = 0.5
PATIENCE_S = 2.0  # after this time without a writable database, the robot must stand
_T = TypeVar("_T")


class Trouble(NamedTuple):
    """The last write failed."""

    since_s: float
    why: str


@dataclass(eq=False)
class _Job:
    call: Callable[[], Any]
    asked_s: float
    kept: bool
    of: Future[Any] | None = None
    done: Future[Any] = field(default_factory=Future)


class RecordWriter:
    """Pass calls of a sink to the worker thread. The methods run on the loop's thread and never wait."""

    def __init__(self, test_writable: Callable[[], None]) -> None:
        self.on_done: Callable[[], object] = lambda: None  # called on the worker's thread after each request
        self._test_writable = test_writable
        self._last_test: _Job | None = None
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="records")
        self._open: list[_Job] = []  # jobs that were not done at the last tick
        self._unwritten: deque[_Job] = deque()  # used by the worker only, in order
        self.trouble: Trouble | None = None  # of the last write; set by the worker

    def ask(self, call: Callable[[], _T], now_s: float) -> Future[_T]:
        """Write a request before it is carried out. If writing fails, it is dropped."""
        job = _Job(call, now_s, kept=False)
        job.done.add_done_callback(lambda _: self.on_done())
        return self._submit(job)

    def keep(self, call: Callable[[], _T], now_s: float, of: Future[Any] | None = None) -> Future[_T]:
        """Write an event as soon as possible. Drop it if `of`, its request, was never written."""
        return self._submit(_Job(call, now_s, kept=True, of=of))

    def run_in_background(self, call: Callable[[], object]) -> None:
        """Run slow work of the control loop on the worker, in order with the records."""
        self._worker.submit(_logged, call)

    def tick(self, now_s: float, watched: bool) -> None:
        """Run the periodic work. `watched`: test whether the database can be written."""
        self._open = [job for job in self._open if not job.done.done()]
        last = self._last_test
        if last and (now_s - last.asked_s < PULSE_S or not last.done.done()):
            return
        if watched or self.trouble:
            self._last_test = _Job(self._test_writable, now_s, kept=False)
            self._submit(self._last_test)

    def overdue(self, now_s: float) -> str | None:
        """Return why nothing could be written for `PATIENCE_S`; None: writing works."""
        trouble = self.trouble
        if trouble and now_s - trouble.since_s > PATIENCE_S:
            return trouble.why
        waiting = next((job for job in self._open if not job.done.done()), None)
        if waiting and now_s - waiting.asked_s > PATIENCE_S:
            return say("no answer from the audit log for {seconds:.0f} s", seconds=PATIENCE_S)
        return None

    def close(self) -> None:
        """Wait for the worker. Records that cannot be written by then are lost."""
        self._worker.shutdown(wait=True)
        if self._unwritten:
            log.error("records that could not be written before the end: %d", len(self._unwritten))

    def _submit(self, job: _Job) -> Future[Any]:
        self._open.append(job)
        self._worker.submit(self._work, job)
        return job.done

    # --- on the worker's thread ----------------------------------------------------------------------

    def _work(self, job: _Job) -> None:
        self._unwritten.append(job)
        while self._unwritten:
            try:
                self._write(self._unwritten[0])
            except RecordError as error:
                self._put_off(job, error)
                break
            self._unwritten.popleft()

    def _write(self, job: _Job) -> None:
        """Write one record. Raises RecordError if it may be tried again."""
        lost = job.of and job.of.exception()  # already done: it was submitted earlier
        if lost:
            job.done.set_exception(lost)
            return
        try:
            result = job.call()
        except BadRecord as error:
            log.error("a record was refused: %s", error)
            self._fail(job, error)
        except RecordError:
            raise
        except Exception as error:
            log.exception("a record failed")
            self._fail(job, error)
        else:
            self.trouble = None
            job.done.set_result(result)

    def _put_off(self, newest: _Job, error: RecordError) -> None:
        """Note that nothing can be written now. Refuse `newest` if it is a request; keep an event."""
        first = self._unwritten[0]
        self._note(first, error)
        if not newest.kept:
            self._unwritten.remove(newest)
            newest.done.set_exception(error)

    def _fail(self, job: _Job, error: Exception) -> None:
        self._note(job, error)
        job.done.set_exception(error)

    def _note(self, job: _Job, error: Exception) -> None:
        since_s = self.trouble.since_s if self.trouble else job.asked_s
        self.trouble = Trouble(since_s, reason_of(error))


def _logged(call: Callable[[], object]) -> None:
    try:
        call()
    except Exception:
        log.exception("background work of the record thread failed")
