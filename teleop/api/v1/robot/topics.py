"""A robot's topics, services and parameters, from the allow-lists, and the topics to which input goes."""

from __future__ import annotations

import threading
import time
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Annotated, Any, TypeVar, get_args

from asgiref.sync import async_to_sync
from drf_spectacular.utils import OpenApiParameter
from msgspec import Meta, Struct

from fleet.accounts.tokens.models import Scope
from robots.shared import wire
from robots.shared.wire import (
    Called,
    Described,
    Graph,
    Parameter,
    Parameters,
    Rate,
    Refusal,
    Sample,
    TopicName,
    TypeName,
    Use,
)
from teleop.api.v1.framework.operation import operation
from teleop.api.v1.framework.rates import place_in
from teleop.api.v1.programs import topic_queries
from teleop.api.v1.programs.registry import programs
from teleop.api.v1.robot.control import ProgramView
from teleop.api.v1.robot.tasks import acts

MOST_ASKING = 6  # queries at the same time: each occupies a thread, and pages need threads, too

_asking = threading.BoundedSemaphore(MOST_ASKING)
_BUSY = Refusal("busy", "Too many questions about topics are asked at once: try again in a moment.", "robot")


class TopicAsked(Struct, frozen=True, forbid_unknown_fields=True):
    """The topic that is meant."""

    topic: TopicName


class TypeAsked(Struct, frozen=True, forbid_unknown_fields=True):
    """The message type that is meant; with `topic`, as its publisher has it."""

    type: TypeName
    topic: TopicName | None = None


class ServiceAsked(Struct, frozen=True, forbid_unknown_fields=True):
    """The service that is meant."""

    service: TopicName


class ParameterAsked(Struct, frozen=True, forbid_unknown_fields=True):
    """The parameter that is meant, or tree of them."""

    name: TopicName


class PublishRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """A message: once (`rate_hz` 0), or at a rate until it is ended. Fields left out are zero, empty, or now."""

    topic: TopicName
    type: TypeName
    fields: dict[str, Any] = {}
    rate_hz: Rate = 0.0


class CallRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """A service, and the fields of its request."""

    service: TopicName
    fields: dict[str, Any] = {}


class SetRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """A parameter, and its new value."""

    name: TopicName
    value: Any


class ChooseRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """Target of this use of input from now on; null: the default."""

    topic: Annotated[str, Meta(max_length=255)] | None = None


Answer = TypeVar("Answer", bound=Struct)
_topics = partial(operation, scope=Scope.TOPICS, refuses=(404, 409))


class TopicsBase(ProgramView):
    """Base of the views below."""

    tag = "topics"

    def ask(self, slug: str, query: Any, answer: type[Answer]) -> Answer:
        """Send one query, and return its answer. Raises `Problem` or `NotDone`."""
        found: Answer = self._answer(slug, topic_queries.ask, query, answer)
        return found

    def message(self, slug: str, topic: str) -> Sample:
        """Return one message of a topic. Raises `Problem` or `NotDone`."""
        return self._answer(slug, topic_queries.one_message, topic)

    def _answer(self, slug: str, question: Callable[..., Awaitable[Answer]], *asked: Any) -> Answer:
        robot = self.robot(slug)
        with place_in(_asking, _BUSY):
            return async_to_sync(question)(programs.path(), robot.slug, self.program_sign_in(), *asked)


class TopicsView(TopicsBase):
    @_topics("topics_list", "List topics, actions and services")
    def get(self, slug: str) -> Graph:
        """Lists the topics, actions and services that the ROS master knows."""
        return self.ask(slug, wire.ListTopics(), Graph)


class DefinitionView(TopicsBase):
    @_topics("topics_definition", "Read the definition of a message")
    def get(self, slug: str, query: TypeAsked) -> Described:
        """As a tree of fields."""
        return self.ask(slug, wire.Describe(query.type, query.topic), Described)


class MessageView(TopicsBase):
    @_topics("topics_message", "Read one message of a topic")
    def get(self, slug: str, query: TopicAsked) -> Sample:
        """The next one, within 6 s. Long arrays are shortened. For a stream use the WebSocket of topics."""
        return self.message(slug, query.topic)


class PublishView(TopicsBase):
    @acts("topics_publish", "Publish a message", wire.PUBLISH, keyed=True)
    def post(self, slug: str, body: PublishRequest) -> None:
        """From the allow-list; needs control. A velocity passes the gate, and is valid for 0.3 s."""
        self.send(
            slug,
            lambda fence, seq: wire.Publish(
                fence, body.topic, body.type, body.fields, body.rate_hz, 1000.0 * time.monotonic(), seq
            ),
        )

    @acts("topics_publish_end", "Stop publishing at a rate", wire.PUBLISH)
    def delete(self, slug: str, query: TopicAsked) -> None:
        """Ends the publication on this topic."""
        self.send(slug, lambda fence, seq: wire.PublishStop(fence, query.topic, seq))


class ServiceView(TopicsBase):
    @_topics("services_definition", "Read the request of a service")
    def get(self, slug: str, query: ServiceAsked) -> Described:
        """As a tree of fields."""
        return self.ask(slug, wire.DescribeService(query.service), Described)


class CallView(TopicsBase):
    @_topics("services_call", "Call a service", keyed=True)
    def post(self, slug: str, body: CallRequest) -> Called:
        """Staff in control of the robot, from the allow-list."""
        return self.ask(slug, wire.CallService(body.service, body.fields), Called)


class ParametersView(TopicsBase):
    @_topics("parameters_list", "List parameters")
    def get(self, slug: str) -> Parameters:
        """Lists the names of all parameters."""
        return self.ask(slug, wire.ListParameters(), Parameters)


class ParameterView(TopicsBase):
    @_topics("parameters_read", "Read a parameter")
    def get(self, slug: str, query: ParameterAsked) -> Parameter:
        """Reads one parameter, or all parameters below a name."""
        return self.ask(slug, wire.GetParameter(query.name), Parameter)

    @_topics("parameters_set", "Set a parameter")
    def put(self, slug: str, body: SetRequest) -> Parameter:
        """Staff in control of the robot, from the allow-list."""
        return self.ask(slug, wire.SetParameter(body.name, body.value), Parameter)


class InputView(TopicsBase):
    @acts(
        "inputs_choose",
        "Choose where input goes",
        wire.CHOOSE,
        parameters=[OpenApiParameter("use", str, OpenApiParameter.PATH, enum=list(get_args(Use)))],
    )
    def put(self, slug: str, use: Any, body: ChooseRequest) -> None:
        """From the allow-list; needs control."""
        self.send(slug, lambda fence, seq: wire.Choose(fence, use, body.topic, seq))


class ForgetView(TopicsBase):
    tag = "control"

    @acts("forget", "Forget remembered obstacles", wire.FORGET)
    def post(self, slug: str) -> None:
        """Needs control, and a robot that stands. Current readings stay."""
        self.send(slug, wire.Forget)
