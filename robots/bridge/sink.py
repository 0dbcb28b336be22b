"""Where a bridge's records go: a seam, so that the bridge knows no database.

The methods are called from one worker thread, one at a time and in order. A method returns once
its record is committed; `RecordError` means that it is not, and nothing that needs the record happens.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from msgspec import Struct

from robots.bridge.gate.values import Verdict

Parameters = Mapping[str, str | float | None]


class RecordError(Exception):
    """A record could not be committed. The text says why, in words for the operator."""


class Holder(Struct, frozen=True):
    """Who drives, as granted."""

    holder_id: str
    holder: str
    session: str
    fence: int


class DriveSummary(Struct, frozen=True):
    """What a drive came to, from odometry: metres, seconds, m/s, rad/s."""

    distance_m: float
    duration_s: float
    top_mps: float
    top_radps: float
    interventions: int
    ended_by: str  # "standstill", or what stopped it


class GateSummary(Struct, frozen=True):
    """What an intervention of the gate came to."""

    duration_s: float  # from its first to its last verdict
    also: list[str]  # codes of other rules that held back meanwhile


class RecordSink(Protocol):
    """The audit log, as the bridge sees it. Tokens are opaque to the bridge."""

    def begin_drive(self, holder: Holder) -> int:
        """Commit the start of a drive: before its first non-zero Twist."""

    def end_drive(self, drive: int, holder: Holder, summary: DriveSummary) -> None:
        """Commit the end of a drive."""

    def request(self, holder: Holder, kind: str, parameters: Parameters) -> int:
        """Commit what was asked of the robot besides driving: before it is passed on."""

    def outcome(self, request: int, holder: Holder, kind: str, outcome: str, parameters: Parameters) -> None:
        """Commit what came of it."""

    def begin_gate(self, drive: int, holder: Holder, verdict: Verdict) -> int:
        """Commit that the gate began to hold back, and why."""

    def end_gate(self, intervention: int, holder: Holder, summary: GateSummary) -> None:
        """Commit that it ended, and what it came to."""
