"""Writes a bridge's records into the audit log.

Plain facts, such as duration and distance of a drive, are kept as long as the record. Places, texts and sensor data may
expire or be erased.
"""

from __future__ import annotations

import functools
import os
import threading
from collections.abc import Callable, Sequence
from typing import Any, ParamSpec, TypedDict, TypeVar, cast
from uuid import UUID

from django.core.exceptions import ValidationError
from django.db import (
    DatabaseError,
    InterfaceError,
    InternalError,
    OperationalError,
    close_old_connections,
    connection,
    transaction,
)
from django.db.models import Exists, Max, OuterRef
from django.utils import timezone

from fleet.accounts.models import User
from fleet.audit.errors import AuditUnavailable, cause_of
from fleet.audit.models import Record
from fleet.audit.services import record
from robots.recordings.file_cuts import file_cut, file_cuts
from robots.recordings.services import (
    file_changed,
    file_changes,
    recording_gone,
    recording_store,
)
from robots.registry.maps import map_store
from robots.registry.models import BridgePulse, RobotDescription
from robots.shared import wire
from robots.shared.geometry.poses import Pose, Velocity
from robots.shared.records.record_sink import (
    BadRecord,
    DriveSummary,
    FileChange,
    FileCut,
    GateStart,
    GateSummary,
    Holder,
    Parameters,
    Position,
    RecordError,
    Sample,
    TakenDescription,
    TakenMap,
    TakenRecording,
)
from robots.shared.records.verdict import Verdict
from robots.shared.sentences import say
from robots.shared.wire import HealthLevel

MOST_CHANGES = 10_000  # changes of health that are read; enough for weeks, even if parts change often

P = ParamSpec("P")
T = TypeVar("T")

# For each kind of record: the kind of the record of its end, and the outcome if the bridge was killed before the end.
ENDS = {kind.record: (kind.outcome, "unknown") for kind in wire.TASK_KINDS} | {
    "gate.begin": ("gate.end", "bridge_killed"),
    "drive.start": ("drive.end", "bridge_killed"),
    "motion.cancel": ("motion.cancel", "unknown"),
    "go.hold": ("go.hold", "unknown"),
    "stop.moves": ("stop.moves", "unknown"),
}
# Parameters of a request that may expire: places, and what a person wrote (sentences are in `text`)
_EXPIRING = ("fields", "place", "x_m", "y_m", "heading_rad")


_File = tuple[int, int]  # device and inode


class _Opened(threading.local):
    """A connection to an SQLite database, and the database file and write-ahead log when it was opened."""

    by: object = None
    files: tuple[_File, _File | None] | None = None


_opened = _Opened()


def _check_file() -> None:
    """For SQLite, open a new connection if the database file or the write-ahead log is not the same file any more.

    An open connection keeps writing to the files that it opened. If a file was removed or replaced, nobody can read
    what is written to it. While a connection is open, only the restore of a backup removes the log. Raises
    `RecordError` if there is no database file.
    """
    if connection.vendor != "sqlite":
        return
    name = connection.settings_dict["NAME"]
    file = _file_of(name)
    if file is None:
        connection.close()
        raise RecordError(say("the file of the database is gone"))
    if connection.connection is _opened.by and (file, _log_of(name)) != _opened.files:
        connection.close()
    connection.ensure_connection()
    if connection.connection is not _opened.by:
        _opened.by, _opened.files = connection.connection, (file, _log_of(name))


def _log_of(name: object) -> _File | None:
    return _file_of(f"{name}-wal")


def _file_of(name: str) -> _File | None:
    """Return device and inode of the file with this name; None if there is none."""
    try:
        status = os.stat(name)
    except OSError:
        return None
    return status.st_dev, status.st_ino


def _as_record_error(method: Callable[P, T]) -> Callable[P, T]:
    """Decorator: turn errors of the database into `RecordError` or `BadRecord`, with the reason in words.

    The connection may stay open between calls. After an error the next call opens a new connection.
    """

    @functools.wraps(method)
    def call(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            close_old_connections()
            _check_file()
            return method(*args, **kwargs)
        except AuditUnavailable as error:
            connection.close()
            raise RecordError(cause_of(error.__cause__ or error)[1]) from error
        except (OperationalError, InternalError, InterfaceError) as error:
            connection.close()
            raise RecordError(cause_of(error)[1]) from error
        except (DatabaseError, ValidationError, ValueError) as error:
            raise BadRecord(say("the audit log refuses this record")) from error

    return call


class AuditSink:
    """A `robots.shared.records.record_sink.RecordSink` that writes the records of one robot by `fleet.audit`."""

    def __init__(self, robot_id: UUID, robot_name: str) -> None:
        self._robot_id = robot_id
        self._robot_name = robot_name

    @_as_record_error
    def settle(self) -> None:
        """Commit the ends that an earlier bridge did not record because it was killed. A second call commits none."""
        with transaction.atomic():
            pulse, _ = BridgePulse.objects.get_or_create(robot_id=self._robot_id)
            for start in self._without_end(pulse.settled):
                kind, outcome = ENDS[start.kind]
                record(kind, of=start, outcome=outcome)
            records = Record.objects.filter(robot_id=self._robot_id)
            pulse.settled = records.aggregate(newest=Max("id"))["newest"] or 0
            pulse.save()

    @_as_record_error
    def test_writable(self) -> None:
        """Commit the time of day, as a test that the database accepts writes."""
        BridgePulse.objects.update_or_create(robot_id=self._robot_id, defaults={"at": timezone.now()})

    @_as_record_error
    def begin_drive(self, holder: Holder, start: Position) -> int:
        """Commit the start of a drive."""
        return record("drive.start", private=_position(start), **self._by(holder)).pk

    @_as_record_error
    def end_drive(self, drive: int, holder: Holder, summary: DriveSummary) -> None:
        """Commit the end of a drive, with its figures."""
        figures = {
            "distance_m": round(summary.distance_m, 3),
            "duration_s": round(summary.duration_s, 2),
            "top_mps": round(summary.top_mps, 3),
            "top_radps": round(summary.top_radps, 3),
            "interventions": summary.interventions,
        }
        where = {
            "words": summary.ended_by,
            "path": _path(summary.path),
            "path_tolerance_m": summary.tolerance_m,
            **_position(summary.end),
        }
        record(
            "drive.end",
            of=drive,
            outcome=summary.outcome,
            parameters=figures,
            private=where,
            **self._by(holder),
        )

    @_as_record_error
    def request(self, holder: Holder | None, kind: str, parameters: Parameters) -> int:
        """Commit the request of a task."""
        facts = dict(parameters)
        text = cast("str", facts.pop("text", ""))
        private = {name: facts.pop(name) for name in _EXPIRING if name in facts}
        return record(kind, parameters=facts, text=text, private=private, **self._by(holder)).pk

    @_as_record_error
    def outcome(
        self, request: int, holder: Holder | None, kind: str, outcome: str, parameters: Parameters
    ) -> None:
        """Commit the outcome of a task."""
        facts = dict(parameters)
        words = facts.pop("text", None)
        private = {"words": words} if words else {}
        record(kind, of=request, outcome=outcome, parameters=facts, private=private, **self._by(holder))

    @_as_record_error
    def begin_gate(self, drive: int, holder: Holder, start: GateStart) -> int:
        """Commit that the gate began to hold back, and why."""
        figures = {
            "words": start.verdict.text,
            "t_s": round(start.t_s, 2),
            "pose": _pose(start.pose),
            **_verdict(start.verdict),
        }
        return record(
            "gate.begin", of=drive, outcome=start.verdict.code, private=figures, **self._by(holder)
        ).pk

    @_as_record_error
    def end_gate(self, intervention: int, holder: Holder, summary: GateSummary) -> None:
        """Commit that the gate no longer holds back, with figures of the intervention."""
        figures = {
            "duration_s": round(summary.duration_s, 2),
            "also": summary.also,
            "nearest": _verdict(summary.nearest),
            "pose": _pose(summary.pose),
        }
        record("gate.end", of=intervention, private=figures, **self._by(holder))

    @_as_record_error
    def stopped(self, holder: Holder | None, number: int, was_standing: bool) -> None:
        """Commit that a stop reached the robot."""
        record(
            "stop.latch",
            parameters={"number": number, "was_standing": was_standing},
            **self._by(holder) | {"actor": None},  # the holder need not have pressed it
        )

    @_as_record_error
    def ill_parts(self) -> dict[str, HealthLevel]:
        """Return the parts that were not well in their last record, with their levels."""
        changes = Record.objects.filter(robot_id=self._robot_id, kind__in=("health.worse", "health.better"))
        newest = changes.order_by("-id").values_list("parameters", flat=True)[:MOST_CHANGES]
        levels: dict[str, HealthLevel] = {}
        for change in newest.iterator(chunk_size=500):
            levels.setdefault(change["part"], change["to"])
        return {part: level for part, level in levels.items() if level != "ok"}

    @_as_record_error
    def keep_map(self, taken: TakenMap) -> None:
        """Commit that this is the robot's map now."""
        map_store(self._robot_id, taken, timezone.now())

    @_as_record_error
    def keep_description(self, taken: TakenDescription) -> None:
        """Commit that this is the robot's description now."""
        columns = {"digest": taken.digest, "packed": taken.packed, "problem": taken.problem}
        RobotDescription.objects.update_or_create(
            robot_id=self._robot_id, defaults={**columns, "seen_at": timezone.now()}
        )

    @_as_record_error
    def keep_recording(self, taken: TakenRecording) -> None:
        """Commit that this recording exists."""
        recording_store(self._robot_id, taken)

    @_as_record_error
    def drop_recording(self, recording: UUID) -> None:
        """Commit that the file of this recording was removed."""
        recording_gone(recording)

    @_as_record_error
    def recording_changes(self, after: UUID | None) -> list[tuple[str, FileChange]]:
        """Return what must be done with finished files."""
        return [(str(recording), change) for recording, change in file_changes(after)]

    @_as_record_error
    def recording_changed(self, recording: UUID, change: FileChange) -> None:
        """Commit that this was done."""
        file_changed(recording, change)

    @_as_record_error
    def recording_cuts(self, after: UUID | None) -> list[FileCut]:
        """Return which files must lose people who were erased."""
        return file_cuts(after)

    @_as_record_error
    def recording_cut(self, done: FileCut) -> None:
        """Commit that a file has lost them."""
        file_cut(done)

    def _without_end(self, after: int) -> list[Record]:
        """Return this robot's records after `after` that have no end, the newest first."""
        missing: list[Record] = []
        for kind, (end, _) in ENDS.items():
            ends = Record.objects.filter(of=OuterRef("pk"), kind=end)
            starts = Record.objects.filter(robot_id=self._robot_id, kind=kind, pk__gt=after)
            if kind == end:
                # Skip ends, and records that had an outcome at once, such as the cancel of a motion by a person.
                starts = starts.filter(of=None, outcome="")
            missing += starts.exclude(Exists(ends))
        return sorted(missing, key=lambda start: -start.pk)

    def _by(self, holder: Holder | None) -> _By:
        return {
            "actor": User.objects.filter(pk=holder.holder_id).first() if holder else None,
            "robot_id": self._robot_id,
            "robot_name": self._robot_name,
            "session_id": UUID(holder.session) if holder else None,
            "fence": holder.fence if holder else None,
        }


class _By(TypedDict):
    actor: User | None
    robot_id: UUID
    robot_name: str
    session_id: UUID | None
    fence: int | None


def _position(position: Position) -> dict[str, Any]:
    return {"pose": _pose(position.pose), "map_to_odom": _pose(position.map_to_odom)}


def _pose(pose: Pose | None) -> list[float] | None:
    """Return x and y in metres, yaw in radians."""
    return None if pose is None else [round(value, 3) for value in pose]


def _path(path: Sequence[Sample]) -> list[list[float]]:
    """Return t, x, y, yaw and speed of each sample."""
    return [[round(value, 3) for value in sample] for sample in path]


def _verdict(verdict: Verdict) -> dict[str, Any]:
    return {
        "sensor": verdict.sensor,
        "distance_m": _rounded(verdict.distance_m),
        "bearing_rad": _rounded(verdict.bearing_rad),
        "side": verdict.side,
        "asked": _velocity(verdict.asked),
        "allowed": _velocity(verdict.velocity),
    }


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 3)


def _velocity(velocity: Velocity) -> dict[str, float]:
    return {"vx_mps": round(velocity.vx, 3), "vy_mps": round(velocity.vy, 3), "w_radps": round(velocity.w, 3)}
