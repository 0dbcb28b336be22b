"""Interface of the audit log, so that the bridge does not depend on a database.

One worker thread calls the methods, one at a time and in order. A method returns when its record is
committed. It raises `RecordError` if the record is not committed: then the action must not happen.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, NamedTuple, Protocol
from uuid import UUID

from msgspec import Struct

from robots.shared.geometry.poses import Pose
from robots.shared.records.verdict import Verdict
from robots.shared.wire import HealthLevel, RecordingEvent, RecordingKind

Parameters = Mapping[str, str | float | None]


class RecordError(Exception):
    """A record could not be committed now. The text says why, for the operator."""


class BadRecord(RecordError):
    """A record that can never be committed: do not try again."""


class Holder(Struct, frozen=True):
    """The person in control, from the grant."""

    holder_id: str
    holder: str
    session: str
    fence: int


class Position(Struct, frozen=True):
    """The robot's position as far as known: metres and radians."""

    pose: Pose | None = None  # in the odometry frame
    map_to_odom: Pose | None = None  # of the odometry frame in the map frame


class Sample(NamedTuple):
    """The robot's position in the odometry frame."""

    t_s: float  # since the drive began
    x: float  # metres
    y: float
    yaw: float  # rad, continuous beyond a full turn, so that values between samples can be interpolated
    speed: float  # m/s


DriveEnd = Literal["standstill", "halted", "control_changed", "bridge_ended"]


class DriveSummary(Struct, frozen=True):
    """Summary of a drive from odometry: metres, seconds, m/s, rad/s."""

    outcome: DriveEnd
    ended_by: str  # the outcome in words
    end: Position
    distance_m: float
    duration_s: float
    top_mps: float
    top_radps: float
    interventions: int
    path: list[Sample]
    tolerance_m: float  # of the path


class GateStart(Struct, frozen=True):
    """Begin of a gate intervention."""

    verdict: Verdict
    t_s: float  # since the drive began
    pose: Pose | None


class GateSummary(Struct, frozen=True):
    """Summary of a gate intervention."""

    duration_s: float  # from its first to its last verdict
    also: list[str]  # codes of other rules that limited the robot during it
    nearest: Verdict  # with the nearest obstacle
    pose: Pose | None  # at its end


class TakenMap(Struct, frozen=True, tag=True):
    """The robot's map as a picture. `origin` is its lower left corner, as in nav_msgs/OccupancyGrid."""

    resolution_m: float  # of a cell; one cell is one pixel
    origin: Pose  # in the map frame
    width: int  # cells
    height: int
    picture: bytes  # PNG; the first row is the upper edge
    digest: str  # of picture and position


class TakenDescription(Struct, frozen=True):
    """The robot's description (URDF), compressed by zlib. `problem`: why it cannot be used."""

    digest: str  # of the text
    packed: bytes
    problem: str = ""


ABOUT = "fleet"  # name of the metadata in which a file has its `TakenRecording` as JSON, with the key `taken`


class RecordedTopic(Struct, frozen=True):
    """A topic in a recording. A topic that changed its type is there once for each type."""

    topic: str
    type: str
    messages: int
    dropped: int = 0


class KeptEvent(Struct, frozen=True):
    """An event for which a black box was kept, or which a recording on request shows."""

    event: RecordingEvent
    at: float  # Unix time, s
    text: str = ""  # what happened, in English
    by: str = ""  # who did it, for a stop or "Keep this"


class ShownControl(Struct, frozen=True):
    """A time of a recording in which somebody had control, by the clock of its file."""

    session: str
    begins: float  # Unix time, s
    ends: float


class TakenRecording(Struct, frozen=True, tag=True):
    """A finished recording: one MCAP file. The file has the same in its metadata `fleet`."""

    recording: UUID
    robot: str  # id
    kind: RecordingKind
    begins: float  # Unix time, s
    ends: float
    bytes: int
    directory: str  # on the computer of the bridge
    name: str  # of the file there; beside it, with the ending .jpg, a small picture of `thumbnail`
    topics: list[RecordedTopic]
    events: list[KeptEvent] = []
    person: str = ""  # id: who asked for it, or had control
    session: str = ""  # of control
    booking: str = ""
    course: str = ""
    reason: str = ""
    version: str = ""  # of the console
    dropped: int = 0  # messages that are missing in it
    left_out: int = 0  # topics that are not in it: there were more than `MOST_RECORDED_TOPICS`
    continues: UUID | None = None  # the recording that the same request began, before a process broke
    cut: bool = False  # its process broke: its last second may be missing
    ended_by: str = ""  # why it ended, in English, if nobody asked for it
    thumbnail: bool = False
    # The clock of the web process that notes sessions may differ. None: not known, because it was cut
    controls: list[ShownControl] | None = None


# Decisions of people about a finished file
FileChange = Literal["remove", "keep", "let_go"]


class FileCut(Struct, frozen=True):
    """The rest of a file that shows erased people.

    `taken`: what its metadata say from then on; after the cut also times, topics and size of the file, which is removed
    (0 bytes) if nothing stays.
    """

    taken: TakenRecording
    stays: list[tuple[int, int]]  # times (ns since 1970), ends exclusive, in order


class RecordSink(Protocol):
    """The audit log, as the bridge uses it. The returned numbers only identify records."""

    def settle(self) -> None:
        """Commit ends that an earlier bridge of this robot did not record. Called before other methods."""

    def test_writable(self) -> None:
        """Test whether a record could be committed."""

    def begin_drive(self, holder: Holder, start: Position) -> int:
        """Commit the start of a drive, before its first twist that is not zero."""

    def end_drive(self, drive: int, holder: Holder, summary: DriveSummary) -> None:
        """Commit the end of a drive."""

    def request(self, holder: Holder | None, kind: str, parameters: Parameters) -> int:
        """Commit a request of a task before it is sent to the robot. None: the bridge requests it itself."""

    def outcome(
        self, request: int, holder: Holder | None, kind: str, outcome: str, parameters: Parameters
    ) -> None:
        """Commit the outcome of a request."""

    def begin_gate(self, drive: int, holder: Holder, start: GateStart) -> int:
        """Commit that the gate began to limit the robot, and why."""

    def stopped(self, holder: Holder | None, number: int, was_standing: bool) -> None:
        """Commit that stop `number` reached the robot. The web process records who pressed it.

        `was_standing`: at the press, the robot stood and had no command to move.
        """

    def end_gate(self, intervention: int, holder: Holder, summary: GateSummary) -> None:
        """Commit the end of an intervention and its summary."""

    def ill_parts(self) -> dict[str, HealthLevel]:
        """Return the parts of the robot whose last record reports a problem, with their levels."""

    def keep_map(self, taken: TakenMap) -> None:
        """Commit the robot's present map. The robot does not wait for it."""

    def keep_description(self, taken: TakenDescription) -> None:
        """Commit the robot's present description. The robot does not wait for it."""

    def keep_recording(self, taken: TakenRecording) -> None:
        """Commit that this recording exists. Called again with the same `recording` if it is not certain."""

    def drop_recording(self, recording: UUID) -> None:
        """Commit that the file of this recording was removed: a black box, for newer recordings."""

    def recording_changes(self, after: UUID | None) -> list[tuple[str, FileChange]]:
        """Return what must be done with finished files, of all robots, by id of the recording and in its order.

        `after`: the last id of the answer before. The end of the list is an empty answer.
        """

    def recording_changed(self, recording: UUID, change: FileChange) -> None:
        """Commit that this was done."""

    def recording_cuts(self, after: UUID | None) -> list[FileCut]:
        """Return which files must lose people who were erased: as `recording_changes`."""

    def recording_cut(self, done: FileCut) -> None:
        """Commit that a file has lost them."""
