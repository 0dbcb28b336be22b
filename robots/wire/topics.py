"""The robot's topics, services and parameters: queries, subscriptions and answers."""

from __future__ import annotations

from typing import Any

from msgspec import Struct

from robots.wire.base import (
    Ack,
    Ping,
    Refusal,
    Refused,
    SampleRate,
    Seq,
    TopicName,
    TypeName,
    _require_shallow,
)


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
    """Staff, from the allow-list, recorded first. Answer: `Parameter`."""

    name: TopicName
    value: Any
    seq: Seq = 0

    def __post_init__(self) -> None:
        _require_shallow(self.value)


class CallService(Struct, frozen=True, tag_field="t", tag="call"):
    """Staff, from the allow-list, recorded first. Answer: `Called`."""

    service: TopicName
    fields: dict[str, Any] = {}
    seq: Seq = 0

    def __post_init__(self) -> None:
        _require_shallow(self.fields)


TopicQuery = (
    ListTopics | Describe | DescribeService | ListParameters | GetParameter | SetParameter | CallService
)


class Subscribe(Struct, frozen=True, tag_field="t", tag="subscribe"):
    """Show the messages of a topic, newest wins, at most `rate_hz` of them; `Sample` follows, each after an `Ack`."""

    topic: TopicName
    rate_hz: SampleRate = 5.0


class Unsubscribe(Struct, frozen=True, tag_field="t", tag="unsubscribe"):
    """Show that topic no more."""

    topic: TopicName


TopicsMessage = TopicQuery | Subscribe | Unsubscribe | Ack | Ping


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
    """Answer of a service."""

    service: str
    fields: dict[str, Any]
    seq: int = 0
    shortened: dict[str, int] = {}  # as in `Sample`


TopicAnswer = Graph | Described | Parameters | Parameter | Called | Refused


class Sample(Struct, frozen=True, tag_field="t", tag="sample"):
    """A message of a topic, big arrays shortened, and how the topic was over the last seconds."""

    topic: str
    type: str
    number: int  # of this message, counting all received ones
    rate_hz: float | None
    bytes: int
    age_s: float | None  # now, since its header's stamp, by the console's clock; None: no stamp
    publishers: int
    fields: dict[str, Any]
    shortened: dict[str, int] = {}  # whole lengths of arrays that are shown in part, by path
    refusal: Refusal | None = None  # why it cannot be shown
    publisher_names: list[str] = []  # nodes, as many as are named
    since_s: float | None = None  # this message came so long ago; None: none came
