"""The state of a robot and the view of its surroundings. Bridge to page, through the web process."""

from __future__ import annotations

from typing import Literal

from msgspec import Struct

from robots.wire.base import Refusal, Role, Use
from robots.wire.health import Health
from robots.wire.limbs import Limb, LimbState
from robots.wire.navigation import GoEnd, GoProgress, Location

# The gate's words (bridge/gate/values.py), which knows no wire: mypy sees in bridge/view.py that none is missing here.
Side = Literal["ahead", "ahead left", "left", "behind left", "behind", "behind right", "right", "ahead right"]
Way = Literal["forward", "left", "reverse", "right", "bend", "turn"]


class SpeedLimit(Struct, frozen=True, omit_defaults=True):
    """A speed limit for every request. It holds the robot back if code and way are the verdict's."""

    code: str  # of the rule, as in `Verdict`
    text: str  # "held to 0.3 m/s: no picture of the depth camera has come yet"
    mps: float
    way: Way | None = None  # which it holds for; None: for all


class Verdict(Struct, frozen=True, omit_defaults=True):
    """The gate's answer to the last command. See docs/protocol.md for the codes."""

    code: str  # "free", "idle", or the rule that holds back
    text: str  # one line for the operator
    asked: tuple[float, float, float]  # vx, vy (m/s), w (rad/s)
    allowed: tuple[float, float, float]
    sensor: str | None = None
    distance_m: float | None = None  # gap between hull and obstacle
    bearing_rad: float | None = None  # of the obstacle, base frame
    side: Side | None = None
    point: tuple[float, float] | None = None
    limits: list[SpeedLimit] = []
    way: Way | None = None  # if a limit on speed holds back: the one that it holds for


class Sensor(Struct, frozen=True):
    """State of a sensor. `age_s` None: never seen."""

    name: str
    kind: Literal["scan", "sonar", "odometry", "depth"]
    ok: bool
    age_s: float | None
    text: str = ""


class Odometry(Struct, frozen=True):
    """Pose in the odometry frame and speed in the base frame."""

    x: float
    y: float
    yaw: float
    vx: float
    vy: float
    w: float


class StopState(Struct, frozen=True):
    """`state`: "clear", "stopping" (zeros sent), "stopped" (odometry confirms standstill).

    `number` grows with every press and is never used twice, also not by a bridge that was started again.
    """

    state: Literal["clear", "stopping", "stopped"]
    by: str | None = None
    reason: str = ""
    standstill_ms: float | None = (
        None  # press -> standstill by odometry; None also of a robot that stood already
    )
    number: int = 0
    was_standing: bool = False  # at the press, and until standstill was confirmed


class Motion(Struct, frozen=True):
    """A recorded motion that this console started, from the moment it was asked for."""

    name: str
    who: str
    since_s: float


class MotionEnd(Struct, frozen=True):
    """The end of such a motion. `number` grows with each.

    `outcome`: succeeded, rejected or failed (by the robot); cancelled, stopped, intruder, not_watched, control_ended,
    link_lost, not_recorded, unheard.
    """

    number: int
    name: str
    outcome: str
    text: str


SpeechStatus = Literal["sent", "accepted", "speaking"]


class Speech(Struct, frozen=True):
    """A text that the robot says for this console, from the moment it was sent.

    `status` comes from the robot's action; a robot that takes plain messages reports none.
    """

    number: int  # of its record
    text: str
    language: str
    topic: str
    who: str
    status: SpeechStatus
    since_s: float
    word: tuple[int, int] | None = None  # the spoken word, if the robot reports it: first character, last + 1


class SpeechEnd(Struct, frozen=True):
    """End of the task.

    `outcome`: done, failed or rejected (by the robot); sent (a plain message: end not known); cancelled, stopped,
    unheard; a refusal's code if it was recorded but could not begin any more.
    """

    number: int  # of its record, as in `Speech`
    outcome: str
    text: str  # why, or the robot's own words


class DriveByProgress(Struct, frozen=True):
    """A drive by a distance or an angle, from its start: what was asked for, and how far it is by odometry."""

    number: int  # of its record
    who: str
    goal_m: float | None
    goal_rad: float | None
    distance_m: float  # along the heading at the start
    angle_rad: float
    since_s: float


class DriveByEnd(Struct, frozen=True):
    """End of the task.

    `outcome`: done; held_back (the gate let the robot no farther, or a sensor that it needs fell silent); stopped;
    control_lost; replaced (by the stick or a published velocity); no_odometry; late (the bridge was); no_progress (the
    robot does not obey); cancelled, input_moved, bridge_ended; or a refusal's code.
    """

    number: int  # of its record, as in `DriveByProgress`
    seq: int  # of the request, and its fence
    fence: int
    outcome: str
    text: str
    because: str | None  # the code of the verdict, refusal or halt that ended it
    distance_m: float  # as in `DriveByProgress`, when it ended
    angle_rad: float


class ChoiceEnd(Struct, frozen=True):
    """End of a choice by itself: its topic is gone, and input goes to the default `to` again."""

    number: int  # of the choice's record
    topic: str
    to: str
    text: str


class Publishing(Struct, frozen=True):
    """A message that is published at a rate."""

    topic: str
    type: str
    rate_hz: float


# No master; a master, no odometry or drive topic yet; all is there; the master does not have this bridge, or another.
Phase = Literal["waiting", "connecting", "online", "refused"]


class NeutralNeeded(Struct, frozen=True):
    """Why the stick must return to the middle before the robot moves; `text` goes on where a sentence says so."""

    code: str  # see docs/protocol.md
    text: str


OverloadedPart = Literal["bridge", "console"]


class Overload(Struct, frozen=True):
    """The console's computer does not keep up: this part of it woke so late in the last seconds."""

    part: OverloadedPart
    late_s: float


class State(Struct, frozen=True):
    """The robot as its bridge knows it."""

    phase: Phase
    text: str  # one line in words
    stop: StopState
    verdict: Verdict
    odometry: Odometry | None
    sensors: list[Sensor]
    battery_percent: float | None
    charging: bool | None
    holder: str | None
    fence: int | None
    seq: int | None  # of the newest drive message that came in order and in time
    neutral_needed: NeutralNeeded | None
    foreign: list[str]  # other nodes that publish to the drive topic
    watchers: list[str]  # as many as are named; see `watchers_more`
    clock_skew_s: float | None
    refused: dict[str, int]  # refused messages so far, by code
    latency_s: float = 0.0  # from a command to odometry that shows it, as the gate assumes
    latency_measured: bool = False  # else it is the profile's
    arm: list[tuple[float, float, float]] = []  # beyond the base: discs x, y, radius (base frame)
    watchers_more: int = 0
    motion: Motion | None = None
    motion_ended: MotionEnd | None = None  # the last one
    speech: Speech | None = None
    speech_ended: SpeechEnd | None = None  # the last one
    drive_by: DriveByProgress | None = None
    drive_by_ended: DriveByEnd | None = None  # the last one
    location: Location | None = None  # None: not known
    going: GoProgress | None = None
    going_ended: GoEnd | None = None  # the last one
    navigation_held: str = ""  # why the bridge holds the base though no goal is under way
    limbs: dict[Limb, LimbState] = {}  # limbs of the robot
    chosen: dict[Use, str] = {}  # the topic where input goes instead of the default
    choice_ended: dict[Use, ChoiceEnd] = {}  # the last that ended by itself, until the next choice
    publishing: list[Publishing] = []
    overload: Overload | None = None
    unseen_s: float | None = None  # since odometry last came; None: it never did
    watchdog_missing: bool = False  # for 5 s or more: a stop depends on the bridge alone
    health: Health | None = None  # None: no node of the robot reports
    battery_left_min: int | None = (
        None  # at the pace of the last half hour; None: not known, or on the charger
    )


class MotionOffer(Struct, frozen=True):
    """A recorded motion of the robot, in its own words."""

    name: str  # as it is played
    title: str
    usage: str = ""  # its group
    description: str = ""
    duration_s: float | None = None


class UseOffer(Struct, frozen=True):
    """Default target of one use of input, and the type that a topic (an action) must have."""

    topic: str
    type: str
    chooseable: dict[str, Role] = {}  # topics that may be chosen instead, and from which role on
    refusal: Refusal | None = None  # why the topic cannot be used now: no node on the robot reads it


class Offers(Struct, frozen=True, tag_field="t", tag="offers"):
    """The robot's capabilities: on connecting and on change."""

    motions: list[MotionOffer] = []
    motions_text: str = ""  # why there is none
    languages: list[str] = []  # in which it speaks, BCP 47, its own first
    uses: dict[Use, UseOffer] = {}  # a robot that does not speak has no "speech"
    publishable: dict[str, str] = {}  # topics, and of which type: the allow-list
    publishable_from: dict[str, Role] = {}  # the same topics, and from which role on


class Scan(Struct, frozen=True):
    """Seen points, current base frame, centimetres, flat [x0, y0, x1, y1, ...]."""

    laser_cm: list[int]
    sonar_cm: list[int | None]  # by index of RobotFacts.sonars; None: nothing in range
    depth_cm: list[int] = []
    remembered_cm: list[int] = []  # seen before, and not to be seen from here and now
    # where round the base neither laser nor sonar looks: counter-clockwise from one bearing to the other, radians
    unseen: list[tuple[float, float]] = []
    # between which heights each of `depth_cm` was seen, while a page draws the robot in 3D: flat [low0, high0, ...]
    heights_cm: list[int] = []


class View(Struct, frozen=True, omit_defaults=True, tag_field="t", tag="view"):
    """The state and surroundings of the robot, for its viewers. The next one comes after `Ack`."""

    state: State
    scan: Scan | None  # None: nothing is drawn
    joints: dict[
        str, float
    ] = {}  # positions (rad, m) of joints of the description, while a page draws the robot
