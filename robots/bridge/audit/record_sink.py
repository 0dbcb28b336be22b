"""Interface of the record store, so that the bridge knows no database.

The methods are called from one worker thread, one at a time and in order. A method returns once its record is
committed. On `RecordError` it is not, and nothing that needs the record happens.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, Protocol

from msgspec import Struct

from robots.bridge.audit.drive_path import Sample
from robots.bridge.gate.values import Pose, Verdict

Parameters = Mapping[str, str | float | None]


class RecordError(Exception):
    """A record could not be committed now. The text says why, in words for the operator."""


class BadRecord(RecordError):
    """A record that is never committed, however well the database is: to try again would not help."""


class Holder(Struct, frozen=True):
    """The person in control, as granted."""

    holder_id: str
    holder: str
    session: str
    fence: int


class Place(Struct, frozen=True):
    """Where the robot is, as far as it knows: metres and radians."""

    pose: Pose | None = None  # in the odometry frame
    map_to_odom: Pose | None = None  # that frame in the map's


DriveEnd = Literal["standstill", "halted", "control_changed", "bridge_ended"]


class DriveSummary(Struct, frozen=True):
    """Summary of a drive from odometry: metres, seconds, m/s, rad/s."""

    outcome: DriveEnd
    ended_by: str  # the same in words
    end: Place
    distance_m: float
    duration_s: float
    top_mps: float
    top_radps: float
    interventions: int
    path: list[Sample]
    tolerance_m: float  # of the path


class GateStart(Struct, frozen=True):
    """How an intervention of the gate began."""

    verdict: Verdict
    t_s: float  # since the drive began
    pose: Pose | None


class GateSummary(Struct, frozen=True):
    """Summary of a gate intervention."""

    duration_s: float  # from its first to its last verdict
    also: list[str]  # codes of other rules that held back meanwhile
    nearest: Verdict  # when its obstacle was nearest
    pose: Pose | None  # at its end


class TakenMap(Struct, frozen=True, tag=True):
    """The robot's map as a picture. It lies where nav_msgs/OccupancyGrid says: `origin` is its lower left corner."""

    resolution_m: float  # of a cell, a pixel
    origin: Pose  # in the map's frame
    width: int  # cells
    height: int
    picture: bytes  # PNG; the first row is the upper edge
    digest: str  # of what it shows and where


class RecordSink(Protocol):
    """The audit log, as the bridge sees it. Tokens are opaque to the bridge."""

    def settle(self) -> None:
        """Commit the end of what an earlier bridge of this robot left without one. Comes before everything else."""

    def pulse(self) -> None:
        """Commit something that is no record, to see whether a record could be committed."""

    def begin_drive(self, holder: Holder, start: Place) -> int:
        """Commit the start of a drive: before its first non-zero Twist."""

    def end_drive(self, drive: int, holder: Holder, summary: DriveSummary) -> None:
        """Commit the end of a drive."""

    def request(self, holder: Holder | None, kind: str, parameters: Parameters) -> int:
        """Commit what was asked of the robot besides driving: before it is passed on. None: the bridge does it."""

    def outcome(
        self, request: int, holder: Holder | None, kind: str, outcome: str, parameters: Parameters
    ) -> None:
        """Commit what came of it."""

    def begin_gate(self, drive: int, holder: Holder, start: GateStart) -> int:
        """Commit that the gate began to hold back, and why."""

    def stopped(self, holder: Holder | None, number: int, was_standing: bool) -> None:
        """Commit that stop `number` reached the robot, in whose control. The web process records who pressed it.

        `was_standing`: the robot stood at the press, and nothing asked it to move.
        """

    def end_gate(self, intervention: int, holder: Holder, summary: GateSummary) -> None:
        """Commit that it ended, and what it came to."""

    def keep_map(self, taken: TakenMap) -> None:
        """Commit that this is the robot's map now. No record: the robot does not wait for it."""
