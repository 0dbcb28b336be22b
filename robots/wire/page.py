"""Messages of pages: control, driving and stop; the web process's answers to pages."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, Struct

from robots.wire.base import (
    Axis,
    Fence,
    Milliseconds,
    PendingStop,
    Refusal,
    ReverseSteering,
    Role,
    Seq,
    Share,
    TabToken,
)
from robots.wire.camera import CameraEntry
from robots.wire.limbs import Limb, LimbRange
from robots.wire.state import State


class Hello(Struct, frozen=True, tag_field="t", tag="hello"):
    """First message of a page. `tab` is the tab's own random token: a lease belongs to it."""

    tab: TabToken


class Take(Struct, frozen=True, tag_field="t", tag="take"):
    """Take control of a robot that nobody holds."""


class TakeOver(Struct, frozen=True, tag_field="t", tag="take_over"):
    """Take control from its holder (supervisors and staff), with a reason that is kept."""

    reason: Annotated[str, Meta(min_length=3, max_length=200)]


class Renew(Struct, frozen=True, tag_field="t", tag="renew"):
    """Ask for a fresh term of control: driving does not prolong it."""


class Release(Struct, frozen=True, tag_field="t", tag="release"):
    """Release control."""


class Ask(Struct, frozen=True, tag_field="t", tag="ask"):
    """Wait in line for control; the holder sees it."""


class AskCancel(Struct, frozen=True, tag_field="t", tag="ask_cancel"):
    """Leave the line."""


class HandOver(Struct, frozen=True, tag_field="t", tag="hand_over"):
    """Give control to the person in line whose place has the number `request`."""

    request: int


class Drive(Struct, frozen=True, tag_field="t", tag="drive"):
    """The stick, now. Forwarded to the bridge byte for byte.

    `x` forward, `y` left (holonomic bases), `w` turn left; `share` is the part of the robot's limits that
    a full stick means. `seq` grows with each `Drive` of a connection; `sent_ms` is the browser's monotonic clock
    (performance.now()). `fence` is that of the sender's lease.
    """

    fence: Fence
    seq: Seq
    sent_ms: Milliseconds
    x: Axis
    w: Axis
    y: Axis = 0.0
    share: Share = 0.4


class CameraView(Struct, frozen=True, tag_field="t", tag="camera_view"):
    """The holder drives by a camera whose picture is so old; `age_ms` None: not by a camera any more.

    Sent some five times a second: an old picture limits the speed as a late page does.
    """

    age_ms: Milliseconds | None = None


class ShowJoints(Struct, frozen=True, tag_field="t", tag="show_joints"):
    """The page draws the robot in 3D from now on, or no more. While it does, views have joints and heights."""

    wanted: bool


class Stop(Struct, frozen=True, tag_field="t", tag="stop"):
    """Emergency stop: latched. Anybody signed in who may see the robot."""


class Clear(Struct, frozen=True, tag_field="t", tag="clear"):
    """Clear the latch; moves nothing. The holder, a supervisor or staff.

    `number` is that of the stop which the page showed (`StopState`): a stop pressed since is not cleared unseen.
    """

    number: Seq


class Refresh(Struct, frozen=True, tag_field="t", tag="refresh"):
    """Read the robot's capabilities again. From everybody who may see it; `Offers` follows."""

    seq: Seq = 0


class StopRobot(Struct, frozen=True, tag_field="t", tag="stop"):
    """Emergency stop of one robot, from the fleet page."""

    slug: Annotated[str, Meta(min_length=1, max_length=50)]


class StopAll(Struct, frozen=True, tag_field="t", tag="stop_all"):
    """Emergency stop of every robot that this person may see."""


class ClearRobot(Struct, frozen=True, tag_field="t", tag="clear"):
    """Clear the latch of one robot, from the fleet page. Supervisors and staff. `number` as in `Clear`."""

    slug: Annotated[str, Meta(min_length=1, max_length=50)]
    number: Seq


class Limits(Struct, frozen=True):
    """Meaning of a full stick at share 1 for this robot (m/s, rad/s), with the admin's limits."""

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


class RobotFacts(Struct, frozen=True):
    """Facts of a robot for a page."""

    slug: str  # as in addresses
    name: str  # for people
    profile: str  # its kind, for people
    practice: bool  # a simulated one
    holonomic: bool  # it can slide: `y` of `Drive` counts
    limits: Limits
    footprint: list[tuple[float, float]]  # convex outline, base frame, counter-clockwise
    front_margin_m: float  # the gate leaves so much of the way before an obstacle
    lateral_margin_m: float  # and so much beside the footprint
    default_share: float  # `share` of `Drive` that a page begins with
    max_share: float  # a larger share counts as this
    reverse_steering: ReverseSteering  # car: the turn is mirrored in reverse
    drive_topic: str  # where velocities go if nobody chooses otherwise
    sonars: list[SonarPose]  # in the order of `Scan.sonar_cm`
    stick: str  # steps from stick to gate, in words
    has_head: bool = False  # one that can be asked to look ahead
    has_map: bool = False  # with navigation that drives to its places
    cameras: list[CameraEntry] = []  # cameras that people can watch
    limbs: dict[Limb, LimbRange] = {}  # limbs that people can move


class Welcome(Struct, frozen=True, tag_field="t", tag="welcome"):
    """Answer to `Hello`, and again whenever the robot was edited or the person's rights changed."""

    protocol: int  # a page with another number must reload
    you: str  # your name
    role: Role  # yours on this robot; it decides your rights
    robot: RobotFacts


class Request(Struct, frozen=True):
    """Somebody who waits for control."""

    id: int
    name: str


ControlState = Literal["free", "yours", "elsewhere", "other", "away"]


class Booked(Struct, frozen=True):
    """A booking of the robot. `seconds` are those until its end if it runs, else until its start."""

    name: str  # of the person
    mine: bool
    seconds: float


class Control(Struct, frozen=True, tag_field="t", tag="control"):
    """The holder of control, as this connection may see it. Sent on every change.

    `state`: "free" (take it), "yours", "elsewhere" (yours, in another tab), "other" (see `holder`), "away" (the
    holder's page is gone; free after `resumable_s`).
    `refusal` says why this person may not take control now, None if they may.
    """

    state: ControlState
    holder: str | None = None
    fence: int | None = None  # only for the holder's own tab
    session: str | None = None  # control session id
    remaining_s: float | None = None  # of the term
    resumable_s: float | None = None
    requests: list[
        Request
    ] = []  # people who wait for control, in order: to the holder, and to those who may take over
    asking: int | None = None  # this connection's own place in line
    ahead: int | None = None  # how many wait before it
    offer_s: float | None = None  # so long control is this person's to take, and nobody else's
    may_take_over: bool = False  # this person may say `TakeOver`
    may_clear: bool = False  # this person may say `Clear`
    refusal: Refusal | None = None  # why `Take` would be refused
    booked: Booked | None = None  # the present booking
    next_booked: Booked | None = None  # the next one within a day
    out_s: float | None = (
        None  # until the robot is out of service and this person's control ends; None: not soon
    )


class FleetCard(Struct, frozen=True):
    """One robot on the fleet page. `state` None: not known, and `refusal` says why."""

    state: State | None
    refusal: Refusal | None = None
    seen_at: float | None = None  # as in `BridgeGone`
    may_clear: bool = False  # this person may clear its stop from here
    pending: PendingStop | None = None  # as `stop` in `BridgeGone`, also while the state is known
    booked: Booked | None = None  # the present booking
    next_booked: Booked | None = None  # the next one within a day
    free_in_s: float | None = None  # until its next free time; None: not within a day


class BookingsChanged(Struct, frozen=True, tag_field="t", tag="bookings_changed"):
    """A booking, a policy or an out-of-service period changed: read again what this person may see."""


class Fleet(Struct, frozen=True, tag_field="t", tag="fleet"):
    """The robots that this person may see, by slug. Sent about once a second and on change."""

    robots: dict[str, FleetCard]
