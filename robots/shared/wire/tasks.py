"""Tasks: motions, speech, publishing, head, limbs, drives by a distance or an angle or to a place. Requests, state."""

from __future__ import annotations

from typing import Annotated, Any, Literal, NamedTuple

from msgspec import Meta, Struct

from robots.shared.sentences import say
from robots.shared.wire.base import (
    FARTHEST_HEAD_RAD,
    FARTHEST_M,
    FARTHEST_RAD,
    LARGEST_MESSAGE_BYTES,
    SLOWEST_HZ,
    SLOWEST_MPS,
    SLOWEST_RADPS,
    Fence,
    Language,
    Milliseconds,
    Rate,
    Seq,
    TopicName,
    TypeName,
    Use,
    Worded,
    require_shallow,
)
from robots.shared.wire.limbs import Limb, LimbCancel, LimbState, MoveLimb
from robots.shared.wire.navigation import Go, GoCancel, GoEnd, GoProgress, SetPose

# Prefix of ids of the goals that a bridge sends to the robot; the number of the record follows
GOAL_PREFIX = "fleet_bridge-"
GOAL_MARK = b"fleet\0"  # the same with ROS 2, whose ids are 16 bytes


class LookAhead(Struct, frozen=True, tag_field="t", tag="look_ahead"):
    """Turn the head to the way ahead."""

    fence: Fence
    seq: Seq = 0


class TurnHead(Struct, frozen=True, tag_field="t", tag="turn_head"):
    """Turn the head by these angles (radians; positive: left, up) from its last target; `absolute`: to these angles.

    `here`: from where it is now, if joint states tell that; so zeros stop it. A new request replaces the one on its
    way. `State.head_ended` shows the end.
    """

    fence: Fence
    pan: Annotated[float, Meta(ge=-FARTHEST_HEAD_RAD, le=FARTHEST_HEAD_RAD)]
    tilt: Annotated[float, Meta(ge=-FARTHEST_HEAD_RAD, le=FARTHEST_HEAD_RAD)]
    seq: Seq = 0
    absolute: bool = False
    here: bool = False


class Forget(Struct, frozen=True, tag_field="t", tag="forget"):
    """Forget remembered obstacles; current readings stay. Only while the robot stands still."""

    fence: Fence
    seq: Seq = 0


class Play(Struct, frozen=True, tag_field="t", tag="play"):
    """Perform a recorded motion."""

    fence: Fence
    motion: Annotated[str, Meta(min_length=1, max_length=100)]
    seq: Seq = 0


class PlayCancel(Struct, frozen=True, tag_field="t", tag="play_cancel"):
    """Cancel the motion that this console started. Supervisors and staff without control leave `fence` out."""

    fence: Fence | None = None
    seq: Seq = 0


class Say(Struct, frozen=True, tag_field="t", tag="say"):
    """Say `text`, at most 500 characters. `topic` None: the present topic of speech (`State.chosen`)."""

    fence: Fence
    text: Annotated[str, Meta(max_length=LARGEST_MESSAGE_BYTES)]  # the bridge checks the limit of 500
    language: Language
    topic: TopicName | None = None
    seq: Seq = 0


class SayCancel(Struct, frozen=True, tag_field="t", tag="say_cancel"):
    """Cancel the speech of this console. Without `fence`: as in `PlayCancel`."""

    fence: Fence | None = None
    seq: Seq = 0


class DriveBy(Struct, frozen=True, tag_field="t", tag="drive_by"):
    """Either drive a distance straight on, or turn by an angle on the spot, through the gate.

    The robot must stand. `speed_mps` belongs to `distance_m`, `speed_radps` to `angle_rad`; None: 0.4 of the robot's
    limit, or your part of the limit if that is smaller. `State.drive_by` shows the drive, `State.drive_by_ended` its
    end.
    """

    fence: Fence
    distance_m: Annotated[float, Meta(ge=-FARTHEST_M, le=FARTHEST_M)] | None = None  # negative: backwards
    angle_rad: Annotated[float, Meta(ge=-FARTHEST_RAD, le=FARTHEST_RAD)] | None = None  # positive: left
    speed_mps: Annotated[float, Meta(ge=SLOWEST_MPS, le=10.0)] | None = None
    speed_radps: Annotated[float, Meta(ge=SLOWEST_RADPS, le=10.0)] | None = None
    seq: Seq = 0

    def __post_init__(self) -> None:
        if (self.distance_m is None) == (self.angle_rad is None):
            raise ValueError(say("give either distance_m or angle_rad"))
        if (self.speed_mps if self.distance_m is None else self.speed_radps) is not None:
            raise ValueError(say("speed_mps belongs to distance_m, speed_radps to angle_rad"))


class DriveByCancel(Struct, frozen=True, tag_field="t", tag="drive_by_cancel"):
    """End the drive by a distance or an angle: the robot brakes and stands."""

    fence: Fence
    seq: Seq = 0


class Choose(Struct, frozen=True, tag_field="t", tag="choose"):
    """Send input of this `use` to `topic` (or to the action of this name) from now on; None: to the default."""

    fence: Fence
    use: Use
    topic: TopicName | None = None
    seq: Seq = 0


class Publish(Struct, frozen=True, tag_field="t", tag="publish"):
    """Publish a message: once (`rate_hz` 0), or at a rate until `PublishStop`, a stop, or the end of control.

    `fields`: nested, or with dotted keys ({"linear.x": 0.2}); missing fields are zero, empty, or the present time. A
    twist goes only to the robot's drive topic, through the gate. It is valid for 0.3 s, cannot be repeated at a rate,
    and needs `sent_ms`.
    """

    fence: Fence
    topic: TopicName
    type: TypeName
    fields: dict[str, Any] = {}
    rate_hz: Rate = 0.0
    sent_ms: Milliseconds | None = None  # the sender's monotonic clock
    seq: Seq = 0

    def __post_init__(self) -> None:
        require_shallow(self.fields)
        if 0.0 < self.rate_hz < SLOWEST_HZ:
            raise ValueError(say("rate_hz is 0 for once, else at least {least}", least=SLOWEST_HZ))


class PublishStop(Struct, frozen=True, tag_field="t", tag="publish_stop"):
    """Stop publishing on `topic`."""

    fence: Fence
    topic: TopicName
    seq: Seq = 0


TaskRequest = (
    LookAhead
    | TurnHead
    | Forget
    | Play
    | PlayCancel
    | Say
    | SayCancel
    | DriveBy
    | DriveByCancel
    | Go
    | GoCancel
    | SetPose
    | MoveLimb
    | LimbCancel
    | Choose
    | Publish
    | PublishStop
)


class Motion(Struct, frozen=True):
    """A recorded motion that this console started, from its request on."""

    name: str
    who: str
    since_s: float


class MotionEnd(Worded, frozen=True):
    """The end of a motion that this console started. `number` grows with each end.

    `outcome`: succeeded, rejected or failed (by the robot); cancelled, stopped, intruder, not_watched, control_ended,
    link_lost, not_recorded, unheard.
    """

    number: int
    name: str
    outcome: str
    text: str


SpeechStatus = Literal["sent", "accepted", "speaking"]


class Speech(Struct, frozen=True):
    """A text that the robot speaks for this console, from the moment it was sent.

    `status` comes from the robot's action; a robot that takes plain messages reports no progress: "sent".
    """

    number: int  # of its record
    text: str
    language: str
    topic: str
    who: str
    status: SpeechStatus
    since_s: float
    # the word being spoken, if reported: its first character, last + 1 (code points)
    word: tuple[int, int] | None = None


class SpeechEnd(Worded, frozen=True):
    """The end of a speech.

    `outcome`: done, failed or rejected (by the robot); sent (a plain message: the end is not known); cancelled,
    stopped, unheard; or the code of a refusal if the speech was recorded but could not begin.
    """

    number: int  # of its record, as in `Speech`
    outcome: str
    text: str  # the reason, or the robot's own words


class DriveByProgress(Struct, frozen=True):
    """A drive by a distance or an angle, from its start: the request, and the progress by odometry."""

    number: int  # of its record
    who: str
    goal_m: float | None
    goal_rad: float | None
    distance_m: float  # along the heading at the start
    angle_rad: float
    since_s: float


class DriveByEnd(Worded, frozen=True):
    """The end of a drive by a distance or an angle.

    `outcome`: done; held_back (the gate allowed no more, or a sensor that it needs is silent); stopped; control_lost;
    replaced (by the stick or a published velocity); no_odometry; late (the bridge was late); no_progress (the robot
    does not obey); cancelled, input_moved, bridge_ended; or the code of a refusal.
    """

    number: int  # of its record, as in `DriveByProgress`
    seq: int  # of the request, as `fence`
    fence: int
    outcome: str
    text: str
    because: str | None  # the code of the verdict, refusal or halt that ended it
    distance_m: float  # as in `DriveByProgress`, at the end
    angle_rad: float


class HeadEnd(Worded, frozen=True):
    """The end of a turn of the head, as the robot's action reports it, or else by joint states.

    `outcome`: done; sent (nothing reports where the head is); not_there (it stopped on its way); failed or rejected (by
    the robot's action); unheard, replaced, taken_over; stopped, control_ended, link_lost, not_recorded, bridge_ended.
    """

    seq: int  # of the request, as `fence`; earlier ones of this control were replaced
    fence: int
    outcome: str
    text: str


class ChoiceEnd(Worded, frozen=True):
    """Automatic end of a choice: its topic is gone, and input goes to the default topic `to` again."""

    number: int  # of the choice's record
    topic: str
    to: str
    text: str


class Publishing(Struct, frozen=True):
    """A message that is published at a rate."""

    topic: str
    type: str
    rate_hz: float


class TaskStates(Worded, frozen=True):
    """The fields of `State` about tasks."""

    motion: Motion | None = None
    motion_ended: MotionEnd | None = None  # the last one
    speech: Speech | None = None
    speech_ended: SpeechEnd | None = None  # the last one
    drive_by: DriveByProgress | None = None
    drive_by_ended: DriveByEnd | None = None  # the last one
    going: GoProgress | None = None
    going_ended: GoEnd | None = None  # the last one
    navigation_held: str = ""  # reason why the bridge holds the base although no goal is under way
    limbs: dict[Limb, LimbState] = {}  # by limb of the robot
    head_ended: HeadEnd | None = None  # the last end of a turn
    chosen: dict[Use, str] = {}  # topics that receive input instead of the default topic
    choice_ended: dict[Use, ChoiceEnd] = {}  # the last choice that ended automatically, until the next choice
    publishing: list[Publishing] = []


def gettext_noop(text: str) -> str:
    """Mark a text for translation, which only Django’s processes do."""
    return text


class TaskKind(NamedTuple):
    """One kind of task, as every process knows it. `TASK_KINDS` lists them.

    The door of messages, tokens, REST, the log and a person's own data read it; the bridge has a part for each.
    """

    name: str  # of the kind in REST
    request: type[Struct]
    scope: Literal["drive", "speak", "motions", "topics"]  # that the token of a program needs
    record: str  # kind of the record of its request
    label: str  # of this record in the log and in a person's own data
    end_label: str = (
        ""  # of the record of its outcome, if that has a kind of its own: `….end` after `….start`
    )
    cancel: type[Struct] | None = None
    cancelled_by_others: bool = False  # supervisors and staff may cancel it without control
    address: str = ""  # of its request in REST, below the robot; empty: its views have several
    # Actions, as fields of `Topics` (`robots.shared.configuration.bridge_config`), whose goals a stop cancels; the
    # watchdog does so without a bridge
    stopped_actions: tuple[str, ...] = ()
    # Codes of its outcomes, and names of its parameters, that people read in their language in the log, separated by
    # blanks. Words of several kinds are in `fleet.audit.reading.words`
    words: str = ""

    @property
    def outcome(self) -> str:
        return self.record.replace(".start", ".end")

    @property
    def records(self) -> dict[str, str]:
        """Its kinds of records with their labels."""
        return {self.record: self.label} | ({self.outcome: self.end_label} if self.end_label else {})

    @property
    def requests(self) -> tuple[type[Struct], ...]:
        """The request that begins a task, and the one that cancels it."""
        return (self.request,) if self.cancel is None else (self.request, self.cancel)


SPEECH = TaskKind(
    name="speech",
    request=Say,
    scope="speak",
    record="speech.start",
    label=gettext_noop("asked to say"),
    end_label=gettext_noop("end of speech"),
    cancel=SayCancel,
    cancelled_by_others=True,
    address="speech",
    words="no_speech speaking empty_text text_too_long control_characters",
)
DRIVE_BY = TaskKind(
    name="drive_by",
    request=DriveBy,
    scope="drive",
    record="drive.by",
    label=gettext_noop("drive by a distance or angle"),
    cancel=DriveByCancel,
    address="drive-by",
    words="no_drive driving no_progress",
)
GO = TaskKind(
    name="go",
    request=Go,
    scope="drive",
    record="go.start",
    label=gettext_noop("drive to a place"),
    end_label=gettext_noop("end of a drive to a place"),
    cancel=GoCancel,
    address="go",
    stopped_actions=("navigation.action",),
    words="arrived going goal_in_obstacle goal_outside localisation_missing localisation_old localisation_uncertain "
    "map_changed map_unknown navigation_busy navigation_goes_on no_goal no_navigation too_close",
)
LIMB = TaskKind(
    name="limb",
    request=MoveLimb,
    scope="drive",
    record="limb.start",
    label=gettext_noop("move of gripper or torso"),
    end_label=gettext_noop("end of a move of gripper or torso"),
    cancel=LimbCancel,
    stopped_actions=("gripper.action", "torso.action"),
    words="limb_busy limb_moving limb_unknown no_limb no_move not_there out_of_range stalled",
)
SET_POSE = TaskKind("set_pose", SetPose, "drive", "pose.set", gettext_noop("pose on the map set"))
MOTION = TaskKind(
    name="motion",
    request=Play,
    scope="motions",
    record="motion.start",
    label=gettext_noop("motion asked for"),
    end_label=gettext_noop("end of motion"),
    cancel=PlayCancel,
    cancelled_by_others=True,
    words="motion_blocked motion_running no_motion unknown_motion",
)
LOOK_AHEAD = TaskKind(
    name="look_ahead",
    request=LookAhead,
    scope="drive",
    record="head.look_ahead",
    label=gettext_noop("look ahead"),
    address="look-ahead",
    stopped_actions=("head.point_head",),
)
TURN_HEAD = TaskKind(
    "turn_head", TurnHead, "drive", "head.turn", gettext_noop("turn the head"), address="head"
)
FORGET = TaskKind(
    "forget", Forget, "drive", "memory.forget", gettext_noop("asked to forget obstacles"), address="forget"
)
CHOOSE = TaskKind("choose", Choose, "topics", "topic.choose", gettext_noop("topic chosen"))
PUBLISH = TaskKind(
    name="publish",
    request=Publish,
    scope="topics",
    record="publish.start",
    label=gettext_noop("message asked for"),
    end_label=gettext_noop("end of message"),
    cancel=PublishStop,
    address="topics/publish",
    words="not_publishing",
)

TASK_KINDS = (SPEECH, DRIVE_BY, GO, LIMB, SET_POSE, MOTION, LOOK_AHEAD, TURN_HEAD, FORGET, CHOOSE, PUBLISH)
