"""A bridge's records, in the audit log of the console."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, ParamSpec, TypedDict, TypeVar
from uuid import UUID

from django.core.exceptions import ValidationError
from django.db import DatabaseError, close_old_connections

from fleet.accounts.models import User
from fleet.audit import AuditUnavailable, record
from robots.bridge.gate.values import Velocity, Verdict
from robots.bridge.sink import DriveSummary, GateSummary, Holder, Parameters, RecordError

P = ParamSpec("P")
T = TypeVar("T")


def _or_record_error(method: Callable[P, T]) -> Callable[P, T]:
    """Whatever kept the record from being written, in words; the next call finds a fresh connection."""

    @functools.wraps(method)
    def call(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            close_old_connections()
            return method(*args, **kwargs)
        except AuditUnavailable as error:
            close_old_connections()
            raise RecordError(error.text) from error
        except (DatabaseError, ValidationError, ValueError) as error:
            close_old_connections()
            raise RecordError("Not done, because it could not be recorded.") from error

    return call


class AuditSink:
    """`robots.bridge.sink.RecordSink` for one robot, over `fleet.audit`."""

    def __init__(self, robot_id: UUID, robot_name: str) -> None:
        self._robot_id = robot_id
        self._robot_name = robot_name

    @_or_record_error
    def begin_drive(self, holder: Holder) -> int:
        """Commit the start of a drive."""
        return record("drive.start", **self._by(holder)).pk

    @_or_record_error
    def end_drive(self, drive: int, holder: Holder, summary: DriveSummary) -> None:
        """Commit the end of a drive, with what it came to."""
        figures = {
            "distance_m": round(summary.distance_m, 3),
            "duration_s": round(summary.duration_s, 2),
            "top_mps": round(summary.top_mps, 3),
            "top_radps": round(summary.top_radps, 3),
            "interventions": summary.interventions,
        }
        record("drive.end", of=drive, outcome=summary.ended_by, parameters=figures, **self._by(holder))

    @_or_record_error
    def request(self, holder: Holder, kind: str, parameters: Parameters) -> int:
        """Commit what was asked of the robot besides driving."""
        return record(kind, parameters=dict(parameters), **self._by(holder)).pk

    @_or_record_error
    def outcome(self, request: int, holder: Holder, kind: str, outcome: str, parameters: Parameters) -> None:
        """Commit what came of it."""
        record(kind, of=request, outcome=outcome, parameters=dict(parameters), **self._by(holder))

    @_or_record_error
    def begin_gate(self, drive: int, holder: Holder, verdict: Verdict) -> int:
        """Commit that the gate began to hold back, and why."""
        figures = {
            "text": verdict.text,
            "sensor": verdict.sensor,
            "distance_m": _rounded(verdict.distance_m),
            "bearing": _rounded(verdict.bearing),
            "side": verdict.side,
            "asked": _velocity(verdict.asked),
            "allowed": _velocity(verdict.velocity),
        }
        return record("gate.begin", of=drive, outcome=verdict.code, parameters=figures, **self._by(holder)).pk

    @_or_record_error
    def end_gate(self, intervention: int, holder: Holder, summary: GateSummary) -> None:
        """Commit that it ended, and what it came to."""
        figures = {"duration_s": round(summary.duration_s, 2), "also": summary.also}
        record("gate.end", of=intervention, parameters=figures, **self._by(holder))

    def _by(self, holder: Holder) -> _By:
        return {
            "actor": _person(holder.holder_id),
            "robot_id": self._robot_id,
            "robot_name": self._robot_name,
            "session_id": UUID(holder.session),
            "fence": holder.fence,
        }


class _By(TypedDict):
    actor: User | None
    robot_id: UUID
    robot_name: str
    session_id: UUID
    fence: int


@functools.lru_cache(maxsize=64)
def _person(holder_id: str) -> User | None:
    return User.objects.filter(pk=holder_id).first()


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 3)


def _velocity(velocity: Velocity) -> dict[str, Any]:
    return {"vx_mps": round(velocity.vx, 3), "vy_mps": round(velocity.vy, 3), "w_radps": round(velocity.w, 3)}
