"""Shared parts of messages: field types with their limits, refusals, answers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

import msgspec
from msgspec import UNSET, Meta, Struct, UnsetType, structs

from robots.shared.sentences import Sentence, of_parts, say

PROTOCOL = 9
LARGEST_MESSAGE_BYTES = 8 * 1024  # from a browser; a view may have up to 64 KiB (Daphne's limit)
MOST_SUBSCRIPTIONS = 30  # subscribed topics of one robot: more do not fit into one message
DEEPEST = 20  # levels of lists and dictionaries in values of any shape
Axis = Annotated[float, Meta(ge=-1.0, le=1.0)]
Share = Annotated[float, Meta(gt=0.0, le=1.0)]
Fence = Annotated[int, Meta(ge=1, le=2**53 - 1)]
Seq = Annotated[int, Meta(ge=0, le=2**53 - 1)]
Milliseconds = Annotated[float, Meta(ge=0.0, le=1e12)]
ShortText = Annotated[str, Meta(max_length=200)]
_NAME = r"^/[A-Za-z][A-Za-z0-9_]*(/[A-Za-z0-9_]+)*"
TopicName = Annotated[str, Meta(max_length=200, pattern=rf"{_NAME}\Z")]
# In ROS 2 a parameter belongs to a node: /play_motion2:motions.wave.joints
ParameterName = Annotated[str, Meta(max_length=200, pattern=rf"{_NAME}(:[A-Za-z0-9_./-]+)?\Z")]
# In ROS 2 with the kind between: geometry_msgs/msg/Twist
_TYPE = r"^[A-Za-z][A-Za-z0-9_]*/((msg|srv|action)/)?[A-Za-z][A-Za-z0-9_]*\Z"
TypeName = Annotated[str, Meta(max_length=120, pattern=_TYPE)]
Language = Annotated[str, Meta(max_length=35, pattern=r"^[A-Za-z]{2,3}(-[A-Za-z0-9]{2,8})*\Z")]  # BCP 47
Use = Literal["drive", "speech", "motions"]
# Each role includes the rights of those before it
Role = Literal["observer", "operator", "supervisor", "staff"]
Rule = Literal[
    "account", "booking", "lease", "dead-man", "gate", "stop", "audit", "wire", "robot", "database", "limits"
]
ReverseSteering = Literal["turn", "car"]  # stick left always turns left; mirrored in reverse
SLOWEST_HZ = 0.1  # of repeated publishing
SLOWEST_MPS = 0.02  # of a drive by a distance; at a lower speed robots get stuck
SLOWEST_RADPS = 0.05
FARTHEST_M = 5.0
FARTHEST_HEAD_RAD = 1.5  # of one turn of the head
FARTHEST_RAD = math.tau
Rate = Annotated[float, Meta(ge=0.0, le=50.0)]  # Hz; 0 is once
SampleRate = Annotated[float, Meta(ge=SLOWEST_HZ, le=10.0)]  # Hz
TabToken = Annotated[str, Meta(min_length=16, max_length=64, pattern=r"^[A-Za-z0-9_-]+\Z")]


# Sentences by their field: key in the catalogue, figures by name, key for a `count` other than one
Said = dict[str, list[Any]]


class Worded(Struct, frozen=True, kw_only=True):
    """A message with sentences for people, in English.

    `said` has key and figures of those with figures, for a page in another language. Any other is its own key.
    """

    SENTENCES: ClassVar[tuple[str, ...]] = ("text",)  # fields

    said: Said | UnsetType = UNSET

    def __post_init__(self) -> None:
        """Split sentences into plain texts and `said`."""
        for field in self.SENTENCES:
            sentence = getattr(self, field)
            if type(sentence) is Sentence:
                structs.force_setattr(self, field, str(sentence))
                said = {name: parts for name, parts in (self.said or {}).items() if name != field}
                if sentence.figures:
                    said[field] = sentence.parts
                structs.force_setattr(self, "said", said or UNSET)

    @property
    def sentence(self) -> Sentence:
        """The text with its key and figures, to be a figure of another sentence."""
        return self.sentence_of("text")

    def sentence_of(self, field: str) -> Sentence:
        """Return the text of a field with its key and figures."""
        text = getattr(self, field)
        return of_parts(text, (self.said or {}).get(field, [text]))


class Refusal(Worded, frozen=True, omit_defaults=True):
    """The reason why a request was not executed: data for programs, a sentence for people.

    `code` is stable and for programs. `text` is one plain sentence; if the person can do something, it names that.
    `rule` names the link of the chain that refused. `figures` holds the numbers of the reason, with units in the keys.
    """

    code: str
    text: str
    rule: Rule
    figures: Mapping[str, float | int | str | None] = msgspec.field(default_factory=dict)

    @property
    def coded_text(self) -> str:
        """Code and text as one text, for protocols that have no field for each."""
        return f"{self.code}: {self.text}"


class NotDone(Exception):
    """A request that was not executed; `refusal` has the reason."""

    def __init__(self, refusal: Refusal) -> None:
        super().__init__(refusal.text)
        self.refusal = refusal


class WireError(NotDone):
    """An invalid message."""


def require_shallow(value: Any, levels: int = DEEPEST) -> None:
    """Raise ValueError if a value of any shape has more levels."""
    if levels < 0:
        raise ValueError(say("values are nested deeper than {most} levels", most=DEEPEST))
    if isinstance(value, dict):
        value = value.values()
    elif not isinstance(value, list):
        return
    for part in value:
        require_shallow(part, levels - 1)


class Ack(Struct, frozen=True, tag_field="t", tag="ack"):
    """The last message of the stream (view, sample) was shown: the console may send the next one."""


class Ping(Struct, frozen=True, tag_field="t", tag="ping"):
    """The web process answers at once with `Pong`: the page measures the round trip time."""

    sent_ms: Milliseconds


Level = Literal["info", "warning", "error"]


class Notice(Worded, frozen=True, tag_field="t", tag="notice"):
    """News for the person: control ended (with the reason), somebody asks for control, the robot was edited."""

    level: Level
    code: str
    text: str


class Refused(Struct, frozen=True, tag_field="t", tag="refused", omit_defaults=True):
    """A message was not executed. `of` is its kind, `seq` its number if it had one."""

    of: str
    refusal: Refusal
    seq: int | None = None
    fence: int | None = None


class Accepted(Struct, frozen=True, tag_field="t", tag="accepted", omit_defaults=True):
    """A message of kind `of` was accepted: it is on its way to the robot, or already done."""

    of: str
    seq: int = 0
    fence: int | None = None


class Pong(Struct, frozen=True, tag_field="t", tag="pong"):
    """Answer to `Ping`."""

    sent_ms: float


class PendingStop(Struct, frozen=True):
    """A stop that neither bridge nor watchdog has confirmed yet."""

    by: str
    reason: str
    at: float  # time of the press, seconds since 1970


class BridgeGone(Struct, frozen=True, tag_field="t", tag="bridge_gone"):
    """There is no link to the robot's bridge, and the reason. The next `View` ends this state."""

    refusal: Refusal
    seen_at: float | None = None  # time of the robot's last odometry known here, seconds since 1970
    stop: PendingStop | None = None  # the newest pending stop
