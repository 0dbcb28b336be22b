"""The drive log: a drive starts on record before the robot moves and ends at standstill.

Records are committed by the sink in one worker thread; the control loop asks `may_move` and never
waits. Gate interventions are kept as one record when they begin and one when they end.

What flickers is one intervention: it is over when its rule has held nothing back for `MERGE_S`. Another rule that holds
back meanwhile is named in the end's record, and gets records of its own once the first is over. So there are never more
than two records a second; only a stop after which the stick must return to neutral is on record at once, always.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import TypeVar

from robots.bridge.gate.values import Velocity, Verdict
from robots.bridge.sink import DriveSummary, GateSummary, Holder, Parameters, RecordError, RecordSink
from robots.wire import Refusal

log = logging.getLogger(__name__)

RECORD_PATIENCE_S = 2.0  # a record that takes longer stops the robot
_RETRY_S = 0.5
_STANDSTILL_S = 0.5
MERGE_S = 1.0  # a pause of the same intervention, if it is shorter
# Not interventions: nothing is held back that the robot could do.
_QUIET_CODES = frozenset({"idle", "free", "robot_limit"})
_T = TypeVar("_T")

Answer = Callable[[Refusal | None], None]  # to what was asked: why not, or None once it is on its way

WAITING = Refusal("recording", "The drive is being put on record.", "audit")


@dataclass
class _Drive:
    """A drive under way; `number` is known once its start is committed."""

    holder: Holder
    started_s: float
    number: Future[int]
    distance_m: float = 0.0
    top_mps: float = 0.0
    top_radps: float = 0.0
    interventions: int = 0
    still_since_s: float | None = None
    last_xy: tuple[float, float] | None = None
    halted_by: str | None = None


@dataclass
class _Intervention:
    code: str
    holder: Holder
    began_s: float
    held_s: float  # when it held back last
    number: Future[int]
    also: set[str] = field(default_factory=set)  # codes of other rules that held back meanwhile


class DriveLog:
    """At most one drive at a time, and within it at most one gate intervention."""

    def __init__(self, sink: RecordSink) -> None:
        self.on_done: Callable[[], object] = lambda: None  # called on the worker's thread after each record
        self._sink = sink
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="records")
        self._drive: _Drive | None = None
        self._intervention: _Intervention | None = None
        self._failure: tuple[float, str] | None = None  # when, why
        self._pending: list[tuple[float, Future[int] | Future[None]]] = []

    def may_move(self, holder: Holder, now_s: float) -> Refusal | None:
        """None once the drive's start is committed; until then why not. Begins it on the first call."""
        if self._failure:
            failed_s, why = self._failure
            if now_s < failed_s + _RETRY_S:
                return _unrecorded(why)
            self._failure = None
        if self._drive and self._drive.holder.fence != holder.fence:
            self.end(now_s, "control changed")
        if self._drive is None:
            number = self._submit(now_s, lambda: self._sink.begin_drive(holder))
            self._drive = _Drive(holder, now_s, number)
        return None if _committed(self._drive.number) else WAITING

    def moved(self, x: float, y: float, velocity: Velocity) -> None:
        """Odometry: adds to the drive's distance and top speeds."""
        drive = self._drive
        if drive is None:
            return
        if drive.last_xy is not None:
            drive.distance_m += math.hypot(x - drive.last_xy[0], y - drive.last_xy[1])
        drive.last_xy = (x, y)
        drive.top_mps = max(drive.top_mps, math.hypot(velocity.vx, velocity.vy))
        drive.top_radps = max(drive.top_radps, abs(velocity.w))

    def halted(self, reason: str) -> None:
        """Something other than the operator stopped the robot."""
        if self._drive is not None and self._drive.halted_by is None:
            self._drive.halted_by = reason

    def decided(self, verdict: Verdict, now_s: float) -> None:
        """A verdict of the gate on a command of this drive."""
        drive, current = self._drive, self._intervention
        if drive is None or not _committed(drive.number):
            return
        drive.halted_by = None
        if current is not None and (verdict.neutral or now_s - current.held_s >= MERGE_S):
            self._end_intervention(now_s)
            current = None
        if verdict.code in _QUIET_CODES:
            return
        if current is None:
            self._begin_intervention(drive, verdict, now_s)
        elif current.code == verdict.code:
            current.held_s = now_s
        else:
            current.also.add(verdict.code)

    def tick(self, now_s: float, still: bool) -> Refusal | None:
        """Once per period. `still`: zero is sent and odometry shows standstill.

        Returns why the robot must stop, if it must.
        """
        self._reap(now_s)
        drive = self._drive
        if drive is not None and _failed(drive.number):
            self._drive = None
        elif drive is not None:
            if not still:
                drive.still_since_s = None
            else:
                drive.still_since_s = drive.still_since_s or now_s
                if now_s - drive.still_since_s >= _STANDSTILL_S:
                    self.end(now_s, drive.halted_by or "standstill")
        if self._failure and now_s < self._failure[0] + _RETRY_S:
            return _unrecorded(self._failure[1])
        if self._pending and now_s - self._pending[0][0] > RECORD_PATIENCE_S:
            return _unrecorded(f"no answer from the audit log for {RECORD_PATIENCE_S:.0f} s")
        return None

    def request(self, holder: Holder, kind: str, parameters: Parameters, now_s: float) -> Future[int]:
        """Put on record what is asked of the robot besides driving; its number, once it is committed."""
        return self._submit(now_s, lambda: self._sink.request(holder, kind, parameters))

    def outcome(
        self, request: int, holder: Holder, kind: str, outcome: str, parameters: Parameters, now_s: float
    ) -> None:
        """Put on record what came of it."""
        self._submit(now_s, lambda: self._sink.outcome(request, holder, kind, outcome, parameters))

    def end(self, now_s: float, ended_by: str) -> None:
        """End the drive under way, if any."""
        drive, self._drive = self._drive, None
        if drive is None or _failed(drive.number):
            return
        self._end_intervention(now_s)
        summary = DriveSummary(
            distance_m=round(drive.distance_m, 3),
            duration_s=round(now_s - drive.started_s, 3),
            top_mps=round(drive.top_mps, 3),
            top_radps=round(drive.top_radps, 3),
            interventions=drive.interventions,
            ended_by=ended_by,
        )
        self._submit(now_s, lambda: self._sink.end_drive(drive.number.result(), drive.holder, summary))

    def close(self, now_s: float) -> None:
        """End what is open and wait for the records."""
        self.end(now_s, "bridge ended")
        self._worker.shutdown(wait=True)

    def _begin_intervention(self, drive: _Drive, verdict: Verdict, now_s: float) -> None:
        number, holder = drive.number.result(), drive.holder
        drive.interventions += 1
        begun = self._submit(now_s, lambda: self._sink.begin_gate(number, holder, verdict))
        self._intervention = _Intervention(verdict.code, holder, now_s, now_s, begun)

    def _end_intervention(self, now_s: float) -> None:
        current, self._intervention = self._intervention, None
        if current is None or _failed(current.number):
            return
        summary = GateSummary(round(current.held_s - current.began_s, 3), sorted(current.also))
        self._submit(now_s, lambda: self._sink.end_gate(current.number.result(), current.holder, summary))

    def _submit(self, now_s: float, call: Callable[[], _T]) -> Future[_T]:
        future = self._worker.submit(call)
        future.add_done_callback(lambda _: self.on_done())
        self._pending.append((now_s, future))  # type: ignore[arg-type]
        return future

    def _reap(self, now_s: float) -> None:
        """Forget what is done; remember a failure."""
        while self._pending and self._pending[0][1].done():
            _, future = self._pending.pop(0)
            error = future.exception()
            if error is not None:
                if not isinstance(error, RecordError):
                    log.error("record failed", exc_info=error)
                self._failure = (now_s, str(error))


def not_recorded(error: BaseException) -> Refusal:
    """What to answer where a record could not be committed."""
    return Refusal("not_recorded", f"It was not done, for it cannot be recorded ({error}).", "audit")


def _committed(number: Future[int]) -> bool:
    return number.done() and number.exception() is None


def _failed(number: Future[int]) -> bool:
    return number.done() and number.exception() is not None


def _unrecorded(why: str) -> Refusal:
    return Refusal(
        "not_recorded", f"The robot stands still: what it does cannot be recorded ({why}).", "audit"
    )
