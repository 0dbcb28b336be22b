"""The robot's topics, services and parameters: queries, subscriptions and answers."""

from __future__ import annotations

from typing import Any

from msgspec import Struct

from robots.shared.wire.base import (
    Ack,
    ParameterName,
    Ping,
    Refusal,
    Refused,
    SampleRate,
    Seq,
    TopicName,
    TypeName,
    require_shallow,
)


class ListTopics(Struct, frozen=True, tag_field="t", tag="topics"):
    """Every topic, action and service of the robot. Answer: `Graph`."""

    seq: Seq = 0


class Describe(Struct, frozen=True, tag_field="t", tag="describe"):
    """The definition of a message type, as the publisher of `topic` or this console has it. Answer: `Described`."""

    type: TypeName
    topic: TopicName | None = None
    seq: Seq = 0


class DescribeService(Struct, frozen=True, tag_field="t", tag="describe_service"):
    """The fields of a service's request. Answer: `Described`."""

    service: TopicName
    seq: Seq = 0


class ListParameters(Struct, frozen=True, tag_field="t", tag="parameters"):
    """Names of the robot's parameters. Answer: `Parameters`."""

    seq: Seq = 0


class GetParameter(Struct, frozen=True, tag_field="t", tag="parameter"):
    """One parameter, or a tree of them. Answer: `Parameter`. Long texts are cut unless `whole` is true."""

    name: ParameterName
    seq: Seq = 0
    whole: bool = False


class SetParameter(Struct, frozen=True, tag_field="t", tag="set_parameter"):
    """Set a parameter of the allow-list. For staff; recorded first. Answer: `Parameter`."""

    name: ParameterName
    value: Any
    seq: Seq = 0

    def __post_init__(self) -> None:
        require_shallow(self.value)


class CallService(Struct, frozen=True, tag_field="t", tag="call"):
    """Call a service of the allow-list. For staff; recorded first. Answer: `Called`, unshortened if `whole` is true."""

    service: TopicName
    fields: dict[str, Any] = {}
    seq: Seq = 0
    whole: bool = False

    def __post_init__(self) -> None:
        require_shallow(self.fields)


TopicQuery = (
    ListTopics | Describe | DescribeService | ListParameters | GetParameter | SetParameter | CallService
)


class ListServiceTypes(Struct, frozen=True, tag_field="t", tag="service_types"):
    """The types of these services; empty: of all. Answer: `ServiceTypes`."""

    services: list[TopicName] = []
    seq: Seq = 0


class LocateService(Struct, frozen=True, tag_field="t", tag="locate_service"):
    """The computer of a service, as its master has it. Answer: `ServiceHost`."""

    service: TopicName
    seq: Seq = 0


class DescribeServiceType(Struct, frozen=True, tag_field="t", tag="describe_service_type"):
    """The fields of a service type's request or response. Answer: `Described`."""

    type: TypeName
    response: bool = False
    seq: Seq = 0


class ListDefinitions(Struct, frozen=True, tag_field="t", tag="definitions"):
    """The definitions of all topics' types. Answer: `Definitions`."""

    seq: Seq = 0


class GetAllParameters(Struct, frozen=True, tag_field="t", tag="all_parameters"):
    """All parameters, whole. Answer: `Parameter`, a tree with the name `/`."""

    seq: Seq = 0


class DeleteParameter(Struct, frozen=True, tag_field="t", tag="delete_parameter"):
    """Delete a parameter of the allow-list. For staff; recorded first. Answer: `Parameter`, without a value."""

    name: ParameterName
    seq: Seq = 0


class GetTime(Struct, frozen=True, tag_field="t", tag="time"):
    """The time by the robot's clock. Answer: `RobotTime`."""

    seq: Seq = 0


# Asked by the doors of other protocols; a page needs none of them
DoorQuery = (
    ListServiceTypes
    | LocateService
    | DescribeServiceType
    | ListDefinitions
    | GetAllParameters
    | DeleteParameter
    | GetTime
)


class Subscribe(Struct, frozen=True, tag_field="t", tag="subscribe"):
    """Show the newest messages of a topic, at most `rate_hz` a second, as `Sample`; the next follows an `Ack`."""

    topic: TopicName
    rate_hz: SampleRate = 5.0


class Unsubscribe(Struct, frozen=True, tag_field="t", tag="unsubscribe"):
    """Stop showing that topic."""

    topic: TopicName


TopicsMessage = TopicQuery | Subscribe | Unsubscribe | Ack | Ping


class TopicRow(Struct, frozen=True):
    """One topic of the robot."""

    name: str
    type: str
    publishers: list[str] = []
    subscribers: list[str] = []


class ActionRow(Struct, frozen=True):
    """One action (topics goal, cancel, status, feedback, result); `type` such as pal_interaction_msgs/TtsAction."""

    name: str
    type: str


class ServiceRow(Struct, frozen=True):
    """One service."""

    name: str
    node: str


class Graph(Struct, frozen=True, tag_field="t", tag="graph"):
    """The robot's topics, actions and services, sorted by name."""

    topics: list[TopicRow]
    actions: list[ActionRow]
    services: list[ServiceRow]
    seq: int = 0


class Field(Struct, frozen=True, omit_defaults=True):
    """One field of a definition. `array`: None: no array; -1: any length; else the fixed length."""

    name: str
    type: str  # as in the definition, without the array: float64, geometry_msgs/Vector3, time
    array: int | None = None
    constants: dict[str, float | int | str | bool] = {}  # of its message, whose type fits this field
    fields: list[Field] = []  # of a nested message


class Described(Struct, frozen=True, tag_field="t", tag="described"):
    """A definition as a tree of fields. `known`: from a package on this computer; else the publisher sent it."""

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
    """The answer of a service."""

    service: str
    fields: dict[str, Any]
    seq: int = 0
    shortened: dict[str, int] = {}  # as in `Sample`


class ServiceTypes(Struct, frozen=True, tag_field="t", tag="types_of_services"):
    """Types by service; those that did not answer in time are missing."""

    types: dict[str, str]
    seq: int = 0


class ServiceHost(Struct, frozen=True, tag_field="t", tag="service_host"):
    """Name or address of the computer of a service; "": the robot has no such service."""

    host: str
    seq: int = 0


class Definitions(Struct, frozen=True, tag_field="t", tag="texts_of_types"):
    """Definitions by type, each followed by the types within it; "" for those that are not known."""

    texts: dict[str, str]
    seq: int = 0


class RobotTime(Struct, frozen=True, tag_field="t", tag="robot_time"):
    """The time by the robot's clock."""

    secs: int
    nsecs: int
    seq: int = 0


TopicAnswer = Graph | Described | Parameters | Parameter | Called | Refused
DoorAnswer = TopicAnswer | ServiceTypes | ServiceHost | Definitions | RobotTime


class Sample(Struct, frozen=True, tag_field="t", tag="sample"):
    """A message of a topic with big arrays shortened, and the topic's rate in the last seconds."""

    topic: str
    type: str
    number: int  # of this message among all received messages of the topic
    rate_hz: float | None
    bytes: int
    # Since the stamp in its header, by the robot's clock; None: no stamp, or of another clock
    age_s: float | None
    publishers: int
    fields: dict[str, Any]
    shortened: dict[str, int] = {}  # full lengths of shortened arrays, by path
    refusal: Refusal | None = None  # reason why it cannot be shown
    publisher_names: list[str] = []  # names of publishing nodes; may be fewer than `publishers`
    since_s: float | None = None  # since this message arrived; None: no message came
