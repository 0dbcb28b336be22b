"""Messages of pages: control, driving and stop; the web process's answers to pages."""

from __future__ import annotations

from typing import Annotated, Literal
from uuid import UUID

from msgspec import Meta, Struct

from robots.shared.wire.base import (
    Axis,
    Fence,
    Milliseconds,
    Refusal,
    ReverseSteering,
    Role,
    Seq,
    Share,
    TabToken,
    Worded,
)
from robots.shared.wire.fleet import Booked
from robots.shared.wire.limbs import Limb, LimbRange
from robots.shared.wire.links.camera import CameraEntry
from robots.shared.wire.recordings import RecordedTopics

Chosen = Annotated[list[Annotated[str, Meta(min_length=1, max_length=500)]], Meta(max_length=200)]


class Hello(Struct, frozen=True, tag_field="t", tag="hello"):
    """First message of a page. `tab` is the tab's own random token: the lease belongs to this token."""

    tab: TabToken


class Take(Struct, frozen=True, tag_field="t", tag="take"):
    """Take control of a robot that nobody holds."""


class TakeOver(Struct, frozen=True, tag_field="t", tag="take_over"):
    """Take control from its holder (supervisors and staff). The reason is recorded.

    With `Control.may_take_back` the reason may be empty, else it has three letters or more.
    """

    reason: Annotated[str, Meta(max_length=200)] = ""


class Renew(Struct, frozen=True, tag_field="t", tag="renew"):
    """Start a new term of control. Driving alone does not extend the term."""


class Release(Struct, frozen=True, tag_field="t", tag="release"):
    """Release control."""


class Ask(Struct, frozen=True, tag_field="t", tag="ask"):
    """Wait in line for control. The holder sees the name."""


class AskCancel(Struct, frozen=True, tag_field="t", tag="ask_cancel"):
    """Leave the line."""


class HandOver(Struct, frozen=True, tag_field="t", tag="hand_over"):
    """Give control to the person in line with this number (`Request.number`)."""

    number: int


class Drive(Struct, frozen=True, tag_field="t", tag="drive"):
    """The present stick position. The web process forwards the bytes to the bridge unchanged.

    `x` forward, `y` left (holonomic bases), `w` turn left. `share`: the part of the robot's limits at a full stick.
    `seq` grows with each `Drive` of a connection. `sent_ms` is the browser's monotonic clock (performance.now()).
    `fence` is the fence of the sender's lease.
    """

    fence: Fence
    seq: Seq
    sent_ms: Milliseconds
    x: Axis
    w: Axis
    y: Axis = 0.0
    share: Share = 0.4


class CameraView(Struct, frozen=True, tag_field="t", tag="camera_view"):
    """The holder drives by a camera; its picture is `age_ms` old. None: no longer by a camera.

    Sent about five times a second. An old picture limits the speed, as a slow connection of the page does.
    """

    age_ms: Milliseconds | None = None


class ShowJoints(Struct, frozen=True, tag_field="t", tag="show_joints"):
    """Whether the page draws the robot in 3D from now on. While it does, views have joints and heights."""

    wanted: bool


class Stop(Struct, frozen=True, tag_field="t", tag="stop"):
    """Emergency stop, latched. For every signed-in person who may see the robot."""


class Clear(Struct, frozen=True, tag_field="t", tag="clear"):
    """Clear the latch; nothing moves. For the holder, supervisors and staff.

    `number` is the number of the stop that the page showed (`StopState`): a later stop is not cleared.
    """

    number: Seq


class Refresh(Struct, frozen=True, tag_field="t", tag="refresh"):
    """Read the robot's capabilities again. For everybody who may see it. `Offers` follows."""

    seq: Seq = 0


class Record(Struct, frozen=True, tag_field="t", tag="record"):
    """Record the robot from now on, until the slot ends. For the person in control, supervisors and staff."""

    topics: RecordedTopics = "pictures_not"
    reason: Annotated[str, Meta(max_length=200)] = ""
    seq: Seq = 0


class RecordEnd(Struct, frozen=True, tag_field="t", tag="record_end"):
    """End this recording (`RecordingState.recording`). For who began it, the person in control, supervisors, staff."""

    recording: UUID
    seq: Seq = 0


class KeepThis(Struct, frozen=True, tag_field="t", tag="keep_this"):
    """Keep the last 30 s and the next 15 s. For the person in control, supervisors and staff."""

    reason: Annotated[str, Meta(max_length=200)] = ""
    seq: Seq = 0


RecordingRequest = Record | RecordEnd | KeepThis


class StopRobot(Struct, frozen=True, tag_field="t", tag="stop"):
    """Emergency stop of one robot, from the fleet page."""

    slug: Annotated[str, Meta(min_length=1, max_length=50)]


class StopAll(Struct, frozen=True, tag_field="t", tag="stop_all"):
    """Emergency stop of every robot that this person may see."""


class ClearRobot(Struct, frozen=True, tag_field="t", tag="clear"):
    """Clear the latch of one robot, from the fleet page. For supervisors and staff. `number` as in `Clear`."""

    slug: Annotated[str, Meta(min_length=1, max_length=50)]
    number: Seq


class Limits(Struct, frozen=True):
    """This robot's speeds at a full stick and share 1 (m/s, rad/s), within the limits set in the admin."""

    forward_mps: float
    reverse_mps: float
    lateral_mps: float
    turn_radps: float


class SonarPose(Struct, frozen=True):
    """A range sensor in the base frame."""

    name: str
    x: float
    y: float
    yaw: float  # of the cone's axis
    fov: float  # the whole cone's angle


class RobotFacts(Worded, frozen=True):
    """Facts of a robot for a page."""

    SENTENCES = ("stick",)

    slug: str  # its name in web addresses
    name: str  # for people
    profile: str  # the kind of robot, for people
    practice: bool  # whether it is simulated
    holonomic: bool  # it can drive sideways: `y` of `Drive` counts
    limits: Limits
    footprint: list[tuple[float, float]]  # convex outline, base frame, counter-clockwise
    front_margin_m: float  # distance that the gate keeps to an obstacle ahead
    lateral_margin_m: float  # distance that the gate keeps beside the footprint
    default_share: float  # first `share` of a new page
    max_share: float  # larger shares are reduced to this
    reverse_steering: ReverseSteering  # car: the turn is mirrored in reverse
    drive_topic: str  # default topic of velocities
    sonars: list[SonarPose]  # in the order of `Scan.sonar_cm`
    stick: str  # steps from stick to gate, in words
    has_head: bool = False  # it has a head that can look ahead
    has_map: bool = False  # it has a map, and navigation that drives to places
    cameras: list[CameraEntry] = []  # cameras that people can watch
    limbs: dict[Limb, LimbRange] = {}  # limbs that people can move
    ros: int = 1  # 1 or 2


class Welcome(Struct, frozen=True, tag_field="t", tag="welcome"):
    """Answer to `Hello`; sent again when the robot was edited or the person's rights changed."""

    protocol: int  # a page with another number must reload
    you: str  # your name
    role: Role  # your role on this robot: it decides your rights
    robot: RobotFacts


class Request(Struct, frozen=True):
    """A person who waits for control: the place's number and the name."""

    number: int
    name: str


ControlState = Literal["free", "yours", "elsewhere", "other", "away"]


class Lesson(Struct, frozen=True):
    """The shared booking that runs now, as its people and those who lead it see its line of turns."""

    booking: str  # its id
    name: str  # of the course, or of the person who booked for a team
    leads: bool  # this person calls, skips, extends and holds the line
    held: bool = False  # nobody is called now
    turn: str | None = None  # the name of the person who is called, or drives in their turn
    yours: bool = False  # this is this person
    driving: bool = False  # the person of `turn` has begun
    turn_s: float | None = None  # until the end of the turn; of a person who is called: to take control
    place: int | None = None  # of this person in line, from 1
    waiting: int = 0  # people in line


TaskList = Literal["motions", "phrases", "places"]


class LessonTasks(Struct, frozen=True):
    """The tasks that a lesson leaves to its members in their turn. An empty list: everything that the robot offers."""

    # Largest part of the robot's speed limits; not for drives to a place, which the robot's own navigation drives
    max_share: Share = 1.0
    motions: Chosen = []  # names
    phrases: Chosen = []  # texts; free texts are refused if there are any
    places: Chosen = []  # names; other goals are refused if there are any
    watch: bool = False  # members only watch
    without: list[TaskList] = []  # no motions, no speech, no drives to a place, whatever their list has

    def chosen(self, kind: TaskList) -> list[str] | None:
        """Return what members may request of a kind; None: everything."""
        listed: list[str] = getattr(self, kind)
        return [] if kind in self.without else listed or None


class Control(Struct, frozen=True, tag_field="t", tag="control"):
    """The state of control, as this connection may see it. Sent on every change.

    `state`: "free" (nobody has control), "yours", "elsewhere" (yours, in another tab), "other" (see `holder`), "away"
    (the holder's page is gone; free after `resumable_s`).
    """

    state: ControlState
    holder: str | None = None
    fence: int | None = None  # only for the holder's own tab
    session: str | None = None  # control session id
    remaining_s: float | None = None  # of the term
    resumable_s: float | None = None
    requests: list[Request] = []  # the line, in order; only for the holder and for persons who may take over
    asking: int | None = None  # `Request.number` of this connection's own place in line
    ahead: int | None = None  # number of people before it in line
    offer_s: float | None = None  # for so long, only this person can take control
    may_take_over: bool = False  # this person may send `TakeOver`
    may_take_back: bool = False  # ... with an empty reason: it is their slot, or they lead the lesson
    may_clear: bool = False  # this person may send `Clear`
    refusal: Refusal | None = None  # reason why this person may not take control now; None: allowed
    booked: Booked | None = None  # the present booking
    next_booked: Booked | None = None  # the next booking within a day
    # until the robot goes out of service and this person's control ends; None: not soon
    out_s: float | None = None
    lesson: Lesson | None = None  # the shared booking with turns that runs now
    tasks: LessonTasks | None = None  # what the present lesson leaves to this person; None: everything


class BookingsChanged(Struct, frozen=True, tag_field="t", tag="bookings_changed"):
    """A booking, a policy or an out-of-service period changed: the page reads its data again."""

    turns: bool = False  # only a turn of a lesson, or who has control


class NewsItem(Struct, frozen=True):
    """A notification that its person has not seen yet."""

    number: int
    subject: str
    text: str
    path: str  # of the page to open; empty: none
    passing: bool  # about this moment, such as "your turn": it disappears by itself


class News(Struct, frozen=True, tag_field="t", tag="news"):
    """The newest notifications of this page's person, newest first. Sent when the page opens, and on change."""

    items: list[NewsItem]
