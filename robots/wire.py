"""Every message that crosses a wire: browser <-> web process <-> bridge.

Each message is one JSON object whose ``t`` names its kind. A door decodes and validates in one
step, with `browser_message`, `link_request` or `link_report`; what does not fit raises `WireError`, which carries the
`Refusal` to answer with. Units are SI unless the name says otherwise; angles are radians; base
frame x forward, y left (REP 103). Joystick axes run from -1 to 1.

A view (`View`) is encoded once by the bridge and travels to every viewer untouched: on the link it
is the only *binary* frame, so that the web process knows it without decoding it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import islice
from typing import Annotated, Any, Generic, Literal, TypeVar
from uuid import UUID

import msgspec
from msgspec import Meta, Struct, structs

PROTOCOL = 5
LARGEST_MESSAGE_BYTES = 8 * 1024  # from a browser; a view may have up to 64 KiB (Daphne's limit)
MOST_LOOKS = 30  # topics of one robot that are looked at: as many as one message has room for
DEEPEST = 20  # levels of lists and dictionaries in values of any shape

Axis = Annotated[float, Meta(ge=-1.0, le=1.0)]
Share = Annotated[float, Meta(gt=0.0, le=1.0)]
Fence = Annotated[int, Meta(ge=1, le=2**53 - 1)]
Seq = Annotated[int, Meta(ge=0, le=2**53 - 1)]
Milliseconds = Annotated[float, Meta(ge=0.0, le=1e12)]
ShortText = Annotated[str, Meta(max_length=200)]
TopicName = Annotated[str, Meta(max_length=200, pattern=r"^/[A-Za-z][A-Za-z0-9_]*(/[A-Za-z0-9_]+)*\Z")]
TypeName = Annotated[str, Meta(max_length=120, pattern=r"^[A-Za-z][A-Za-z0-9_]*/[A-Za-z][A-Za-z0-9_]*\Z")]
Language = Annotated[str, Meta(max_length=35, pattern=r"^[A-Za-z]{2,3}(-[A-Za-z0-9]{2,8})*\Z")]  # BCP 47
Use = Literal["drive", "speech", "motions"]
Role = Literal["observer", "operator", "supervisor", "staff"]  # each may what those before it may
Rule = Literal["account", "lease", "dead-man", "gate", "stop", "audit", "wire", "robot", "database"]
ReverseSteering = Literal["turn", "car"]  # stick left always turns left; mirrored in reverse
SLOWEST_HZ = 0.1  # of what is repeated
Rate = Annotated[float, Meta(ge=0.0, le=50.0)]  # Hz; 0 is once
LookRate = Annotated[float, Meta(ge=SLOWEST_HZ, le=10.0)]  # Hz
TabToken = Annotated[str, Meta(min_length=16, max_length=64, pattern=r"^[A-Za-z0-9_-]+\Z")]


class Refusal(Struct, frozen=True, omit_defaults=True):
    """Why something was not done: data first, words for people beside it.

    `code` is stable and for programs; `text` is one plain sentence that says what to do where
    something can be done; `rule` names the link of the chain that refused; `figures` holds the numbers
    behind it, units in the keys.
    """

    code: str
    text: str
    rule: Rule
    figures: Mapping[str, float | int | str | None] = msgspec.field(default_factory=dict)


class NotDone(Exception):
    """Something is not done; `refusal` says why."""

    def __init__(self, refusal: Refusal) -> None:
        super().__init__(refusal.text)
        self.refusal = refusal


class WireError(NotDone):
    """A message that is not one of ours."""


def _require_shallow(value: Any, levels: int = DEEPEST) -> None:
    if levels < 0:
        raise ValueError(f"values are nested deeper than {DEEPEST} levels")
    if isinstance(value, dict):
        value = value.values()
    elif not isinstance(value, list):
        return
    for part in value:
        _require_shallow(part, levels - 1)


# --- browser -> web --------------------------------------------------------------------------


class Hello(Struct, frozen=True, tag_field="t", tag="hello"):
    """First message of a page. `tab` is the tab's own random token: a lease belongs to it."""

    tab: TabToken


class Take(Struct, frozen=True, tag_field="t", tag="take"):
    """Take control of a robot that nobody holds."""


class TakeOver(Struct, frozen=True, tag_field="t", tag="take_over"):
    """Take control from its holder (supervisors and staff), with a reason that is kept."""

    reason: Annotated[str, Meta(min_length=3, max_length=200)]


class Renew(Struct, frozen=True, tag_field="t", tag="renew"):
    """Ask for a fresh term of control."""


class Release(Struct, frozen=True, tag_field="t", tag="release"):
    """Give control back."""


class Ask(Struct, frozen=True, tag_field="t", tag="ask"):
    """Ask the holder for control."""


class AskCancel(Struct, frozen=True, tag_field="t", tag="ask_cancel"):
    """Withdraw the question."""


class HandOver(Struct, frozen=True, tag_field="t", tag="hand_over"):
    """Give control to the person behind request number `request`."""

    request: int


class Drive(Struct, frozen=True, tag_field="t", tag="drive"):
    """The stick, now. Forwarded to the bridge byte for byte.

    `x` forward, `y` left (holonomic bases), `w` turn left; `share` is the part of the robot's limits that
    a full stick means. `seq` grows with every message of one tab; `sent_ms` is the browser's monotonic clock
    (performance.now()). `fence` is the fencing number of the sender's lease.
    """

    fence: Fence
    seq: Seq
    sent_ms: Milliseconds
    x: Axis
    w: Axis
    y: Axis = 0.0
    share: Share = 0.4


class Stop(Struct, frozen=True, tag_field="t", tag="stop"):
    """Emergency stop: latched. Anybody signed in who may see the robot."""


class Clear(Struct, frozen=True, tag_field="t", tag="clear"):
    """Clear the latch; moves nothing. The holder, a supervisor or staff.

    `number` is that of the stop which the page showed (`StopState`): a stop pressed since is not cleared unseen.
    """

    number: Seq


class Ack(Struct, frozen=True, tag_field="t", tag="ack"):
    """The last view was drawn: the next may be sent."""


class Ping(Struct, frozen=True, tag_field="t", tag="ping"):
    """Answered at once with `Pong`, to measure the way between page and web process."""

    sent_ms: Milliseconds


# What follows asks something of the robot. `seq` grows with every message of one tab and comes back in the one
# answer that each gets: `Accepted` or `Refused`. From the holder (`fence`), forwarded to the bridge.


class LookAhead(Struct, frozen=True, tag_field="t", tag="look_ahead"):
    """Turn the head to where the robot drives."""

    fence: Fence
    seq: Seq = 0


class Forget(Struct, frozen=True, tag_field="t", tag="forget"):
    """Forget what was seen before; what the sensors show now stays. Only while the robot stands still."""

    fence: Fence
    seq: Seq = 0


class Play(Struct, frozen=True, tag_field="t", tag="play"):
    """Perform a recorded motion."""

    fence: Fence
    motion: Annotated[str, Meta(min_length=1, max_length=100)]
    seq: Seq = 0


class PlayCancel(Struct, frozen=True, tag_field="t", tag="play_cancel"):
    """Cancel the motion that this console started. Without `fence`: by a supervisor or staff, without control."""

    fence: Fence | None = None
    seq: Seq = 0


class Say(Struct, frozen=True, tag_field="t", tag="say"):
    """Say `text`, at most 500 characters; `topic` None: where speech goes now (`State.chosen`)."""

    fence: Fence
    text: Annotated[str, Meta(max_length=LARGEST_MESSAGE_BYTES)]  # how long it may be is the bridge's rule
    language: Language
    topic: TopicName | None = None
    seq: Seq = 0


class SayCancel(Struct, frozen=True, tag_field="t", tag="say_cancel"):
    """Cancel what this console has the robot say. Without `fence`: as in `PlayCancel`."""

    fence: Fence | None = None
    seq: Seq = 0


class Choose(Struct, frozen=True, tag_field="t", tag="choose"):
    """Send input of this `use` to `topic` from now on (an action's name for actions); None: to the default."""

    fence: Fence
    use: Use
    topic: TopicName | None = None
    seq: Seq = 0


class Publish(Struct, frozen=True, tag_field="t", tag="publish"):
    """Publish a message: once (`rate_hz` 0), or at a rate until `PublishStop`, a stop, or the end of control.

    `fields`: nested, or with dotted keys ({"linear.x": 0.2}); what is left out is zero, empty, or now. A twist goes to
    the robot's drive topic and nowhere else: through the gate, valid for 0.3 s, never at a rate; it needs `sent_ms`.
    """

    fence: Fence
    topic: TopicName
    type: TypeName
    fields: dict[str, Any] = {}
    rate_hz: Rate = 0.0
    sent_ms: Milliseconds | None = None  # the sender's monotonic clock
    seq: Seq = 0

    def __post_init__(self) -> None:
        _require_shallow(self.fields)
        if 0.0 < self.rate_hz < SLOWEST_HZ:
            raise ValueError(f"rate_hz is 0 for once, else at least {SLOWEST_HZ}")


class PublishStop(Struct, frozen=True, tag_field="t", tag="publish_stop"):
    """Publish no more on `topic`."""

    fence: Fence
    topic: TopicName
    seq: Seq = 0


class Refresh(Struct, frozen=True, tag_field="t", tag="refresh"):
    """Read again what the robot offers. From anybody who may see it; `Offers` follows."""

    seq: Seq = 0


BrowserMessage = (
    Hello
    | Take
    | TakeOver
    | Renew
    | Release
    | Ask
    | AskCancel
    | HandOver
    | Drive
    | LookAhead
    | Forget
    | Play
    | PlayCancel
    | Say
    | SayCancel
    | Choose
    | Publish
    | PublishStop
    | Refresh
    | Stop
    | Clear
    | Ack
    | Ping
)
Order = LookAhead | Forget | Play | PlayCancel | Say | SayCancel | Choose | Publish | PublishStop


class StopRobot(Struct, frozen=True, tag_field="t", tag="stop"):
    """Emergency stop of one robot, from the fleet page."""

    slug: Annotated[str, Meta(min_length=1, max_length=50)]


class StopAll(Struct, frozen=True, tag_field="t", tag="stop_all"):
    """Emergency stop of every robot that this person may see."""


class ClearRobot(Struct, frozen=True, tag_field="t", tag="clear"):
    """Clear the latch of one robot, from the fleet page. Supervisors and staff. `number` as in `Clear`."""

    slug: Annotated[str, Meta(min_length=1, max_length=50)]
    number: Seq


FleetMessage = StopRobot | StopAll | ClearRobot | Ack | Ping


# --- web -> browser --------------------------------------------------------------------------


class Limits(Struct, frozen=True):
    """What a full stick at share 1 means for this robot (m/s, rad/s), after admin tightening."""

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
    """What a page needs to know of a robot once."""

    slug: str  # as in addresses
    name: str  # for people
    profile: str  # its kind, for people
    practice: bool  # a simulated one
    holonomic: bool  # it can slide: `y` of `Drive` counts
    limits: Limits
    footprint: list[tuple[float, float]]  # convex outline, base frame, counter-clockwise
    default_share: float  # `share` of `Drive` that a page begins with
    max_share: float  # a larger share counts as this
    reverse_steering: ReverseSteering  # car: the turn is mirrored in reverse
    drive_topic: str  # where velocities go if nobody chooses otherwise
    sonars: list[SonarPose]  # in the order of `Scan.sonar_cm`
    stick: str  # what its stick passes on the way to the gate, in words
    has_head: bool = False  # one that can be asked to look ahead


class Welcome(Struct, frozen=True, tag_field="t", tag="welcome"):
    """Answer to `Hello`, and again whenever the robot was edited or the person's rights changed."""

    protocol: int  # a page of another number must be loaded anew
    you: str  # your name
    role: Role  # yours on this robot: it rules what you may do
    robot: RobotFacts


class Request(Struct, frozen=True):
    """Somebody who asks for control."""

    id: int
    name: str


ControlState = Literal["free", "yours", "elsewhere", "other", "away"]


class Control(Struct, frozen=True, tag_field="t", tag="control"):
    """Who has control, as this connection may see it. Sent on every change.

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
    requests: list[Request] = []  # who asks for control: to the holder, and to those who may take over
    asking: int | None = None  # this connection's own request
    may_take_over: bool = False  # this person may say `TakeOver`
    may_clear: bool = False  # this person may say `Clear`
    refusal: Refusal | None = None  # why `Take` would be refused


Level = Literal["info", "warning", "error"]


class Notice(Struct, frozen=True, tag_field="t", tag="notice"):
    """Something a person should know: control ended and why, somebody asks, the robot was edited."""

    level: Level
    code: str
    text: str


class Refused(Struct, frozen=True, tag_field="t", tag="refused", omit_defaults=True):
    """A message that was not carried out. `of` is its kind, `seq` its number if it had one."""

    of: str
    refusal: Refusal
    seq: int | None = None
    fence: int | None = None


class Accepted(Struct, frozen=True, tag_field="t", tag="accepted", omit_defaults=True):
    """A message of kind `of` was taken: on its way, or done where there is nothing to wait for."""

    of: str
    seq: int = 0
    fence: int | None = None


class Pong(Struct, frozen=True, tag_field="t", tag="pong"):
    """Answer to `Ping`."""

    sent_ms: float


class PendingStop(Struct, frozen=True):
    """A stop that waits for the robot: nobody has confirmed it yet."""

    by: str
    reason: str
    at: float  # seconds since 1970: when it was pressed


class BridgeGone(Struct, frozen=True, tag_field="t", tag="bridge_gone"):
    """No link to the robot's bridge, and why; a `View` ends it."""

    refusal: Refusal
    seen_at: float | None = None  # seconds since 1970: when the robot was last seen by this web process
    stop: PendingStop | None = None  # the newest that waits


class FleetCard(Struct, frozen=True):
    """One robot on the fleet page. `state` None: not known, and `refusal` says why."""

    state: State | None
    refusal: Refusal | None = None
    seen_at: float | None = None  # as in `BridgeGone`
    may_clear: bool = False  # this person may clear its stop from here
    pending: PendingStop | None = None  # as `stop` in `BridgeGone`, also while the state is known


class Fleet(Struct, frozen=True, tag_field="t", tag="fleet"):
    """The robots that this person may see, by slug. Sent about once a second and on change."""

    robots: dict[str, FleetCard]


# --- bridge -> browser (through the web process, untouched) -----------------------------------


# The gate's words (bridge/gate/values.py), which knows no wire: mypy sees in bridge/view.py that none is missing here.
Side = Literal["ahead", "ahead left", "left", "behind left", "behind", "behind right", "right", "ahead right"]
Way = Literal["forward", "left", "reverse", "right", "bend", "turn"]


class SpeedLimit(Struct, frozen=True, omit_defaults=True):
    """A limit on speed that holds whatever is asked. It is what holds back if code and way are the verdict's."""

    code: str  # of the rule, as in `Verdict`
    text: str  # "held to 0.3 m/s: no picture of the depth camera has come yet"
    mps: float
    way: Way | None = None  # which it holds for; None: for all


class Verdict(Struct, frozen=True, omit_defaults=True):
    """What the gate made of the last command. See docs/protocol.md for the codes."""

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
    """How a sensor is. `age_s` None: never seen."""

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
    """How such a motion ended. `number` tells one from the next.

    `outcome`: succeeded, rejected or failed (by the robot); cancelled, stopped, intruder, not_watched, control_ended,
    link_lost, not_recorded, unheard.
    """

    number: int
    name: str
    outcome: str
    text: str


SpeechStatus = Literal["sent", "accepted", "speaking"]


class Speech(Struct, frozen=True):
    """What this console has the robot say, from the moment it was sent.

    `status` is as the robot's action tells; a robot that takes plain messages tells nothing.
    """

    number: int  # of its record
    text: str
    language: str
    topic: str
    who: str
    status: SpeechStatus
    since_s: float
    word: tuple[int, int] | None = None  # now spoken, where the robot tells: first character, last + 1


class SpeechEnd(Struct, frozen=True):
    """How that ended.

    `outcome`: done, failed or rejected (by the robot); sent (a plain message: nobody tells); cancelled, stopped,
    unheard; a refusal's code where it was on record and could not begin any more.
    """

    number: int
    outcome: str
    text: str  # why, or the robot's own words


class ChoiceEnd(Struct, frozen=True):
    """How a choice ended by itself: its topic is gone, and input goes to the default `to` again."""

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
    seq: int | None  # last drive message that was accepted
    neutral_needed: NeutralNeeded | None
    foreign: list[str]  # other nodes that publish to the drive topic
    watchers: list[str]  # as many as are named; see `watchers_more`
    clock_skew_s: float | None
    refused: dict[str, int]  # refused messages so far, by code
    latency_s: float = 0.0  # from a command to odometry that shows it, as the gate reckons with it
    latency_measured: bool = False  # else it is the profile's
    arm: list[tuple[float, float, float]] = []  # beyond the base: discs x, y, radius (base frame)
    watchers_more: int = 0
    motion: Motion | None = None
    motion_ended: MotionEnd | None = None  # the last one
    speech: Speech | None = None
    speech_ended: SpeechEnd | None = None  # the last one
    chosen: dict[Use, str] = {}  # the topic where input goes instead of the default
    choice_ended: dict[Use, ChoiceEnd] = {}  # the last that ended by itself, until the next choice
    publishing: list[Publishing] = []
    overload: Overload | None = None
    unseen_s: float | None = None  # since odometry last came; None: it never did
    watchdog_missing: bool = False  # for 5 s or more: a stop depends on the bridge alone


class MotionOffer(Struct, frozen=True):
    """A recorded motion of the robot, in its own words."""

    name: str  # as it is played
    title: str
    usage: str = ""  # its group
    description: str = ""
    duration_s: float | None = None


class UseOffer(Struct, frozen=True):
    """Where input of one use goes if nobody chooses otherwise, and of which type a topic (an action) must be."""

    topic: str
    type: str
    chooseable: dict[str, Role] = {}  # topics that may be chosen instead, and from which role on
    refusal: Refusal | None = None  # why nothing may go where it goes now: nobody on the robot takes it


class Offers(Struct, frozen=True, tag_field="t", tag="offers"):
    """What the robot offers besides driving: on connecting, and when it changed."""

    motions: list[MotionOffer] = []
    motions_text: str = ""  # why there is none
    languages: list[str] = []  # in which it speaks, BCP 47, its own first
    uses: dict[Use, UseOffer] = {}  # a robot that does not speak has no "speech"
    publishable: dict[str, str] = {}  # topics, and of which type: the allow-list
    publishable_from: dict[str, Role] = {}  # the same topics, and from which role on


class Scan(Struct, frozen=True):
    """What is seen, in the base frame of now, centimetres, flat [x0, y0, x1, y1, ...]."""

    laser_cm: list[int]
    sonar_cm: list[int | None]  # by index of RobotFacts.sonars; None: nothing in range
    depth_cm: list[int] = []
    remembered_cm: list[int] = []  # seen before, and not to be seen from here and now
    # where round the base neither laser nor sonar looks: counter-clockwise from one bearing to the other, radians
    unseen: list[tuple[float, float]] = []


class View(Struct, frozen=True, tag_field="t", tag="view"):
    """One picture of the robot for its viewers. The next one comes after `Ack`."""

    state: State
    scan: Scan | None  # None: nothing is drawn


# --- the robot's topics: page or application <-> web process <-> bridge <-> inspector ------------


class ListTopics(Struct, frozen=True, tag_field="t", tag="topics"):
    """Every topic, action and service of the robot. Answer: `Graph`."""

    seq: Seq = 0


class Describe(Struct, frozen=True, tag_field="t", tag="describe"):
    """The definition of a message type, as this topic's publisher has it, or as known here. Answer: `Described`."""

    type: TypeName
    topic: TopicName | None = None
    seq: Seq = 0


class DescribeService(Struct, frozen=True, tag_field="t", tag="describe_service"):
    """The request of a service. Answer: `Described`."""

    service: TopicName
    seq: Seq = 0


class ListParameters(Struct, frozen=True, tag_field="t", tag="parameters"):
    """Names of the robot's parameters. Answer: `Parameters`."""

    seq: Seq = 0


class GetParameter(Struct, frozen=True, tag_field="t", tag="parameter"):
    """One parameter, or a tree of them. Answer: `Parameter`."""

    name: TopicName
    seq: Seq = 0


class SetParameter(Struct, frozen=True, tag_field="t", tag="set_parameter"):
    """Staff, and only what the allow-list has; on record first. Answer: `Parameter`."""

    name: TopicName
    value: Any
    seq: Seq = 0

    def __post_init__(self) -> None:
        _require_shallow(self.value)


class CallService(Struct, frozen=True, tag_field="t", tag="call"):
    """Staff, and only what the allow-list has; on record first. Answer: `Called`."""

    service: TopicName
    fields: dict[str, Any] = {}
    seq: Seq = 0

    def __post_init__(self) -> None:
        _require_shallow(self.fields)


Question = (
    ListTopics | Describe | DescribeService | ListParameters | GetParameter | SetParameter | CallService
)


class Look(Struct, frozen=True, tag_field="t", tag="look"):
    """Show the messages of a topic, newest wins, at most `rate_hz` of them; `Shown` follows, each after an `Ack`."""

    topic: TopicName
    rate_hz: LookRate = 5.0


class Unlook(Struct, frozen=True, tag_field="t", tag="unlook"):
    """Show that topic no more."""

    topic: TopicName


TopicsMessage = Question | Look | Unlook | Ack | Ping


class TopicRow(Struct, frozen=True):
    """One topic of the robot."""

    name: str
    type: str
    publishers: list[str] = []
    subscribers: list[str] = []


class ActionRow(Struct, frozen=True):
    """One action: goal, cancel, status, feedback, result; `type` such as pal_interaction_msgs/TtsAction."""

    name: str
    type: str


class ServiceRow(Struct, frozen=True):
    """One service."""

    name: str
    node: str


class Graph(Struct, frozen=True, tag_field="t", tag="graph"):
    """The robot's topics, actions and services, by name."""

    topics: list[TopicRow]
    actions: list[ActionRow]
    services: list[ServiceRow]
    seq: int = 0


class Field(Struct, frozen=True, omit_defaults=True):
    """One field of a definition. `array`: None no array, -1 of any length, else its fixed length."""

    name: str
    type: str  # as in the definition, without the array: float64, geometry_msgs/Vector3, time
    array: int | None = None
    constants: dict[str, float | int | str | bool] = {}  # of its message, that fit this field by their type
    fields: list[Field] = []  # of a nested message


class Described(Struct, frozen=True, tag_field="t", tag="described"):
    """A definition as a tree of fields. `known`: from a package here; else built from the publisher's own words."""

    type: str
    md5: str
    fields: list[Field]
    text: str  # the definition itself
    known: bool = True
    seq: int = 0


class Parameters(Struct, frozen=True, tag_field="t", tag="parameter_names"):
    """The names of the robot's parameters, sorted."""

    names: list[str]
    seq: int = 0


class Parameter(Struct, frozen=True, tag_field="t", tag="parameter_value"):
    """A parameter's value."""

    name: str
    value: Any
    seq: int = 0


class Called(Struct, frozen=True, tag_field="t", tag="called"):
    """What a service answered."""

    service: str
    fields: dict[str, Any]
    seq: int = 0
    shortened: dict[str, int] = {}  # as in `Shown`


Answer = Graph | Described | Parameters | Parameter | Called | Refused


class Shown(Struct, frozen=True, tag_field="t", tag="shown"):
    """A message of a topic, big arrays shortened, and how the topic was over the last seconds."""

    topic: str
    type: str
    number: int  # of this message among all that came
    rate_hz: float | None
    bytes: int
    age_s: float | None  # now, since its header's stamp, by the console's clock; None: no stamp
    publishers: int
    fields: dict[str, Any]
    shortened: dict[str, int] = {}  # whole lengths of arrays that are shown in part, by path
    refusal: Refusal | None = None  # why it cannot be shown
    publisher_names: list[str] = []  # nodes, as many as are named
    since_s: float | None = None  # this message came so long ago; None: none came


# --- web -> bridge (the link) -----------------------------------------------------------------


class LinkHello(Struct, frozen=True, tag_field="t", tag="link_hello"):
    """First on a link. `web` names the process, for logs and for people."""

    protocol: int
    web: ShortText


class Grant(Struct, frozen=True, tag_field="t", tag="grant"):
    """Control for `seconds` from arrival, by the bridge's own clock; repeated to renew.

    The bridge refuses a fencing number below the highest it has ever seen, and the same number under another
    control session.
    """

    fence: Fence
    seconds: Annotated[float, Meta(gt=0.0, le=60.0)]
    session: ShortText
    holder: ShortText
    holder_id: ShortText
    max_share: Share
    delay_s: Annotated[float, Meta(ge=0.0)] | None = None  # web process -> holder's page -> web process


class Revoke(Struct, frozen=True, tag_field="t", tag="revoke"):
    """Control under `fence` ends now."""

    fence: Fence
    reason: ShortText


class Hold(Struct, frozen=True, tag_field="t", tag="hold"):
    """The holder's page is gone: zero at once, stick to neutral before it moves again."""

    fence: Fence
    reason: ShortText


class LinkStop(Struct, frozen=True, tag_field="t", tag="link_stop", omit_defaults=True):
    """Emergency stop. May be the first message of a link; `seq` and `press` come back with the answer.

    `robot` is the robot that is meant (None: the robot of the bridge that hears it); the bridge of another robot
    refuses it. `press` names the press: the same press that arrives twice stops once.
    """

    by: ShortText
    reason: ShortText = ""
    seq: Seq = 0
    robot: UUID | None = None
    press: UUID | None = None
    waited: bool = (
        False  # it was pending: since when the robot should stand, the one who hears it does not know
    )


class LinkLate(Struct, frozen=True, tag_field="t", tag="link_late"):
    """The web process's loop woke so late: commands lay unread there."""

    late_s: Annotated[float, Meta(ge=0.0)]


class LinkClear(Struct, frozen=True, tag_field="t", tag="link_clear"):
    """Clear the latch of stop `number`. The web process has checked the right. `seq` comes back with the answer.

    `presses` are older presses that were never confirmed: if they arrive later, they do not stop again.
    """

    by: ShortText
    number: Seq
    seq: Seq = 0
    presses: Annotated[list[UUID], Meta(max_length=10)] = []


class LinkCancel(Struct, frozen=True, tag_field="t", tag="link_cancel"):
    """Cancel what this console started, by one who need not have control. The web process has checked the right."""

    what: Literal["motion", "speech"]
    by: ShortText
    seq: Seq = 0


class Inspect(Struct, frozen=True, tag_field="t", tag="inspect"):
    """A `Question` about the robot's topics. `seq` comes back with the answer."""

    seq: Seq
    ask: Question


class LookAt(Struct, frozen=True, tag_field="t", tag="look_at"):
    """All topics whose messages are looked at through this web process, with the highest rate that is wanted."""

    topics: dict[TopicName, LookRate]


class Watch(Struct, frozen=True, tag_field="t", tag="watch"):
    """Who looks through this web process, and how many `more`; nobody means no views, only `Status`."""

    watchers: Annotated[list[ShortText], Meta(max_length=20)]
    more: Annotated[int, Meta(ge=0)] = 0


LinkRequest = (
    LinkHello
    | Grant
    | Revoke
    | Hold
    | Drive
    | Order
    | Refresh
    | LinkCancel
    | LinkStop
    | LinkLate
    | LinkClear
    | Watch
    | Inspect
    | LookAt
)


# --- bridge -> web (the link, text frames) ----------------------------------------------------


class BridgeHello(Struct, frozen=True, tag_field="t", tag="bridge_hello"):
    """First from a bridge. `fence` is the highest number it has seen. `Status` and `Offers` follow a `LinkHello`."""

    protocol: int
    robot: str  # UUID
    slug: str
    fence: int


class LaneToken(Struct, frozen=True, tag_field="t", tag="lane"):
    """Beside this link's socket is a lane (`robots.link.lane`); its first datagram is this token."""

    token: str


class Granted(Struct, frozen=True, tag_field="t", tag="granted"):
    """A grant was taken (also answers each renewal)."""

    fence: int


class Ended(Struct, frozen=True, tag_field="t", tag="ended"):
    """Control under `fence` ended at the bridge."""

    fence: int


class Status(Struct, frozen=True, tag_field="t", tag="status"):
    """The state without a picture, twice a second and on change, whoever looks or not."""

    state: State


class Stopped(Struct, frozen=True, tag_field="t", tag="stopped", omit_defaults=True):
    """Answer to a stop or clear, `seq` and `press` as there: the latch as it is now."""

    stop: StopState
    seq: int = 0
    press: UUID | None = None


class Inspected(Struct, frozen=True, tag_field="t", tag="inspected"):
    """The answer to `Inspect`."""

    seq: int
    answer: msgspec.Raw  # an `Answer`, handed on untouched


class Seen(Struct, frozen=True, tag_field="t", tag="seen"):
    """The newest message of a topic that is looked at."""

    topic: str
    shown: msgspec.Raw  # a `Shown`, handed on untouched


BrowserReport = Welcome | Control | Notice | Accepted | Refused | Stopped | BridgeGone | Offers | View | Pong
TopicsReport = Answer | Shown | BridgeGone | Notice | Pong
FleetReport = Fleet | Refused | Pong
LinkReport = (
    BridgeHello
    | LaneToken
    | Granted
    | Ended
    | Status
    | Stopped
    | Accepted
    | Refused
    | Offers
    | Inspected
    | Seen
)


# --- doors ------------------------------------------------------------------------------------

T = TypeVar("T")
_encoder = msgspec.json.Encoder()


class Door(Generic[T]):
    """Takes what somebody said: decoded and validated in one step, or `WireError`. `messages` is what fits, a union."""

    def __init__(self, messages: Any) -> None:
        self._decoder = msgspec.json.Decoder(messages)

    def __call__(self, raw: str | bytes) -> T:
        if len(raw) > LARGEST_MESSAGE_BYTES:
            raise WireError(
                Refusal(
                    "too_large",
                    f"The message has {len(raw)} bytes; at most {LARGEST_MESSAGE_BYTES} are taken.",
                    "wire",
                    {"bytes": len(raw), "limit_bytes": LARGEST_MESSAGE_BYTES},
                )
            )
        try:
            message: T = self._decoder.decode(raw)
        except msgspec.ValidationError as error:
            raise WireError(Refusal("invalid", f"The message does not fit: {error}", "wire")) from error
        except (msgspec.DecodeError, UnicodeError, RecursionError) as error:
            raise WireError(Refusal("not_json", f"Not a JSON message: {error}", "wire")) from error
        return message


browser_message = Door[BrowserMessage](BrowserMessage)
topics_message = Door[TopicsMessage](TopicsMessage)
fleet_message = Door[FleetMessage](FleetMessage)
link_request = Door[LinkRequest](LinkRequest)

# What comes back through the same doors: of any size, and what does not fit is a `msgspec.DecodeError`.
browser_report: Callable[[str | bytes], BrowserReport] = msgspec.json.Decoder(BrowserReport).decode
topics_report: Callable[[str | bytes], TopicsReport] = msgspec.json.Decoder(TopicsReport).decode
link_report: Callable[[str | bytes], LinkReport] = msgspec.json.Decoder(LinkReport).decode  # text frames


class _Heading(Struct):
    t: ShortText = ""
    seq: Seq | None = None


_heading = msgspec.json.Decoder(_Heading)


def heading(raw: str | bytes) -> tuple[str, int | None]:
    """Kind and number of a message that does not fit, as far as it has them: its answer carries them."""
    try:
        found = _heading.decode(raw[:LARGEST_MESSAGE_BYTES])
    except (msgspec.DecodeError, UnicodeError, RecursionError):
        return "", None
    return found.t, found.seq


def kind_of(message: Struct) -> str:
    """Its `t`."""
    return str(type(message).__struct_config__.tag)


def encode(message: Struct) -> bytes:
    """The message as JSON."""
    return _encoder.encode(message)


LARGEST_REPORT_BYTES = (
    1024 * 1024
)  # of what a bridge says of its robot; the link itself takes eight times as much
_CUTS = (
    (2000, 1000),
    (500, 200),
    (100, 50),
    (30, 10),
)  # longest text, most entries of a list: the first that fits


def encode_report(message: Struct) -> bytes:
    """What a bridge says, never larger than `LARGEST_REPORT_BYTES`: whatever a robot tells of itself cuts no link.

    Texts and lists of a larger one are cut, and say how much is missing; answers and messages of topics that were
    encoded elsewhere stay whole.
    """
    encoded = _encoder.encode(message)
    for longest, most in _CUTS:
        if len(encoded) <= LARGEST_REPORT_BYTES:
            break
        encoded = _encoder.encode(_cut(message, longest, most))
    return encoded


def _cut(value: Any, longest: int, most: int) -> Any:
    """`value` with texts and lists cut, at every level; tuples have a length that is part of their type."""
    match value:
        case str() if len(value) > longest:
            return f"{value[: longest - 20]}… ({len(value)} long)"
        case Struct():
            fields = value.__struct_fields__
            return structs.replace(
                value, **{name: _cut(getattr(value, name), longest, most) for name in fields}
            )
        case tuple():
            return tuple(_cut(part, longest, most) for part in value)
        case list():
            kept = [_cut(part, longest, most) for part in value[:most]]
            if len(value) > most and isinstance(value[0], str):
                kept[-1] = f"and {len(value) - most + 1} more"
            return kept
        case dict():
            pairs = islice(value.items(), most)
            return {_cut(key, longest, most): _cut(part, longest, most) for key, part in pairs}
    return value
