"""The drive log: the start of a drive is recorded before the robot moves; the drive ends at standstill.

The control loop calls `may_move` and never waits. Each gate intervention has two records, one at its begin
and one at its end. It ends when its rule has not limited the robot for `MERGE_S`; a shorter pause does not
end it. Other rules may limit the robot during an intervention. They are named in its end record and get their
own records only after it has ended. So there are at most two records a second. One exception: a stop that
requires a neutral stick is always recorded at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

from robots.bridge.audit.drive_path import Path, Track
from robots.bridge.audit.records import Records, unrecorded
from robots.shared.geometry.poses import STILL, Pose, Velocity
from robots.shared.records.record_sink import DriveEnd, DriveSummary, GateStart, GateSummary, Holder, Position
from robots.shared.records.verdict import Verdict
from robots.shared.sentences import say
from robots.shared.wire import Refusal

_STANDSTILL_S = 0.5
MERGE_S = 1.0  # s: a shorter pause belongs to the same intervention
SIMPLIFIED_AT_ONCE = 120  # samples, one minute: bounds the memory of a long drive
# Verdicts that are no interventions: the gate does not slow the robot down below its own speed limit.
_QUIET_CODES = frozenset({"idle", "free", "robot_limit"})

WAITING = Refusal("recording", "The start of the drive is being recorded.", "audit")


class Held(NamedTuple):
    """The gate's intervention that goes on."""

    number: int  # grows
    held_s: float
    text: str


@dataclass
class _Drive:
    """A drive in progress; `number` is known when its start is committed."""

    holder: Holder
    started_s: float
    number: Future[int]
    track: Track
    path: Path = field(default_factory=Path)  # used by the worker thread only
    interventions: int = 0
    still_since_s: float | None = None
    halted_by: str | None = None


@dataclass
class _Intervention:
    holder: Holder
    began_s: float
    number: Future[int]
    nearest: Verdict
    held_s: float  # when the rule last limited the robot
    held_at: Pose | None  # and the robot's pose at that time
    also: set[str] = field(default_factory=set)  # codes of other rules that limited the robot during it

    def holds(self, verdict: Verdict, pose: Pose | None, now_s: float) -> None:
        """Note that the rule still limits the robot."""
        self.held_s, self.held_at = now_s, pose
        if _distance_m(verdict) < _distance_m(self.nearest):
            self.nearest = verdict


class DriveLog:
    """Keep at most one drive in progress, with at most one gate intervention.

    `map_to_odom` returns the pose of the odometry frame in the map frame, if known.
    """

    def __init__(self, records: Records, map_to_odom: Callable[[], Pose | None] = lambda: None) -> None:
        self._records = records
        self._sink = records.sink
        self._map_to_odom = map_to_odom
        self._pose: Pose | None = None
        self._drive: _Drive | None = None
        self._intervention: _Intervention | None = None
        self.interventions = 0  # so far

    def may_move(self, holder: Holder, now_s: float) -> Refusal | None:
        """Return None if the drive's start is committed, else a refusal. The first call begins the drive."""
        if self._drive and self._drive.holder.fence != holder.fence:
            self.end_drive("control_changed", say("control changed"), now_s)
        if self._drive is None:
            self._begin(holder, now_s)
        return None if self._committed else WAITING

    @property
    def why_not(self) -> Refusal | None:
        """Return why no new drive may begin: the last records are not written.

        A drive in progress continues until the records are overdue (`RecordWriter.overdue`).
        """
        trouble = self._records.trouble
        return unrecorded(trouble.why) if trouble is not None and not self._committed else None

    @property
    def under_way(self) -> bool:
        """Return whether a drive is in progress, recorded or not."""
        return self._drive is not None

    @property
    def held(self) -> Held | None:
        """The gate's intervention in progress."""
        current = self._intervention
        if current is None:
            return None
        return Held(self.interventions, current.held_s - current.began_s, current.nearest.text)

    def moved(self, pose: Pose, velocity: Velocity, now_s: float) -> None:
        """Take odometry for the drive's figures and path."""
        self._pose = pose
        if self._drive is not None:
            self._drive.track.moved(pose, velocity, now_s)

    def halted(self, reason: str) -> None:
        """Note that a cause other than the operator stopped the robot."""
        if self._drive is not None and self._drive.halted_by is None:
            self._drive.halted_by = reason

    def decided(self, verdict: Verdict, now_s: float) -> None:
        """Take the gate's verdict on a command of this drive."""
        drive, current = self._drive, self._intervention
        if drive is None or not self._committed:
            return
        drive.halted_by = None
        if current is not None and (verdict.neutral or now_s - current.held_s >= MERGE_S):
            self._end_intervention(now_s)
            current = None
        if verdict.code in _QUIET_CODES:
            return
        if current is None:
            self._begin_intervention(drive, verdict, now_s)
        elif current.nearest.code == verdict.code:
            current.holds(verdict, self._pose, now_s)
        else:
            current.also.add(verdict.code)

    def tick(self, now_s: float, still: bool) -> None:
        """Run the periodic work. `still`: no motion is requested, and odometry shows none or is missing."""
        drive = self._drive
        if drive is None or not drive.number.done():
            return
        if not self._committed:
            self._drive = None
            return
        if len(drive.track.fresh) >= SIMPLIFIED_AT_ONCE:
            self._records.run_in_background(partial(drive.path.extend, drive.track.taken()))
        if not still:
            drive.still_since_s = None
            return
        drive.still_since_s = drive.still_since_s or now_s
        if now_s - drive.still_since_s >= _STANDSTILL_S:
            if drive.halted_by:
                self.end_drive("halted", drive.halted_by, now_s)
            else:
                self.end_drive("standstill", say("standstill"), now_s)

    def end_drive(self, outcome: DriveEnd, ended_by: str, now_s: float) -> None:
        """End the drive in progress, if any."""
        drive = self._drive
        if drive is None:
            return
        self._end_intervention(now_s)
        self._drive = None
        self._records.run_in_background(partial(drive.path.extend, drive.track.taken(last=True)))
        track, end = drive.track, self._position

        def write() -> None:
            summary = DriveSummary(
                outcome=outcome,
                ended_by=ended_by,
                end=end,
                distance_m=track.distance_m,
                duration_s=now_s - drive.started_s,
                top_mps=track.top_mps,
                top_radps=track.top_radps,
                interventions=drive.interventions,
                path=drive.path.samples,
                tolerance_m=drive.path.tolerance_m,
            )
            self._sink.end_drive(drive.number.result(), drive.holder, summary)

        self._records.keep(write, now_s, of=drive.number)

    @property
    def _committed(self) -> bool:
        """Return whether the start of the drive in progress is recorded."""
        number = self._drive.number if self._drive else None
        return number is not None and number.done() and number.exception() is None

    @property
    def _position(self) -> Position:
        return Position(self._pose, self._map_to_odom())

    def _begin(self, holder: Holder, now_s: float) -> None:
        start = self._position
        number = self._records.ask(lambda: self._sink.begin_drive(holder, start), now_s)
        self._drive = _Drive(holder, now_s, number, Track(now_s))
        if self._pose is not None:
            self._drive.track.moved(self._pose, STILL, now_s)

    def _begin_intervention(self, drive: _Drive, verdict: Verdict, now_s: float) -> None:
        drive.interventions += 1
        self.interventions += 1
        number, holder = drive.number.result(), drive.holder
        start = GateStart(verdict, now_s - drive.started_s, self._pose)
        begun = self._records.keep(lambda: self._sink.begin_gate(number, holder, start), now_s)
        self._intervention = _Intervention(holder, now_s, begun, verdict, now_s, self._pose)

    def _end_intervention(self, now_s: float) -> None:
        current, self._intervention = self._intervention, None
        if current is None:
            return
        summary = GateSummary(
            current.held_s - current.began_s, sorted(current.also), current.nearest, current.held_at
        )
        self._records.keep(
            lambda: self._sink.end_gate(current.number.result(), current.holder, summary),
            now_s,
            of=current.number,
        )


def _distance_m(verdict: Verdict) -> float:
    return math.inf if verdict.distance_m is None else verdict.distance_m
