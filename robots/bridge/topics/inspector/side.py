"""The part of the inspector that differs between ROS 1 and ROS 2."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, Protocol

from robots.shared import wire
from robots.shared.messages.definition import Definition


class Received(NamedTuple):
    """One message: its type as its publisher names it, and its definition, which may be declined."""

    type: str
    data: bytes
    definition: Callable[[], Definition]


class Talker(NamedTuple):
    """A publisher of a topic. `type` None: not known yet."""

    name: str
    type: str | None
    md5: str


class Service(NamedTuple):
    """One service of the robot."""

    name: str
    type: str
    request: Definition
    response: Definition
    at: Any = None  # where the side finds it


class Source(Protocol):
    """A subscribed topic."""

    def talkers(self) -> list[Talker]:
        """Return the publishers that are connected now."""
        ...

    def refusal(self) -> wire.Refusal | None:
        """Return why the topic cannot be read although somebody publishes on it."""
        ...

    def close(self) -> None: ...


class Writer(Protocol):
    """A topic on which the inspector publishes."""

    def await_listeners(self, within_s: float) -> None:
        """Wait for listeners: they miss messages that are sent before they are connected."""
        ...

    def send(self, data: bytes) -> None: ...

    def close(self) -> None: ...


class Node(Protocol):
    """The inspector as a node of the robot's ROS."""

    def subscribe(self, topic: str, take: Callable[[Received], None]) -> Source:
        """Subscribe as long as the source is not closed. `take` gets each message, on any thread."""
        ...

    def advertise(self, topic: str, definition: Definition) -> Writer: ...

    def leave(self) -> None: ...


class InspectorSide(Protocol):
    """One robot's topics, services and parameters. Methods raise Declined or Unreachable."""

    def join(self) -> Node:
        """Return the node; it is asked for once, before the first subscription or publication."""
        ...

    def graph(self, seq: int) -> wire.Graph:
        """Return all topics, actions and services, sorted by name."""
        ...

    def definition(self, type_name: str, topic: str | None = None) -> Definition:
        """Return the definition of a publisher of this type on the topic, else the known definition."""
        ...

    def imitated(self, definition: Definition) -> str | None:
        """Return a type that moves the base, if this definition has the same content under another name."""
        ...

    def texts(self) -> dict[str, str]:
        """Return the texts of the definitions of all topics' types, by type; "" if it is not known."""
        ...

    def service(self, name: str) -> Service: ...

    def service_part(self, type_name: str, response: bool) -> Definition:
        """Return the definition of a service type's request or response."""
        ...

    def service_types(self, names: Iterable[str]) -> dict[str, str]:
        """Return the types of these services, or of all; those that do not answer in time are missing."""
        ...

    def service_host(self, name: str) -> str:
        """Return the name or address of a service's computer; "" if there is no such service."""
        ...

    def call(self, service: Service, request: bytes, require_time: Callable[[], None], largest: int) -> bytes:
        """Call a service; return its answer. `require_time` is called just before the request is sent."""
        ...

    def parameter_names(self) -> list[str]: ...

    def has_parameter(self, name: str) -> bool: ...

    def parameter(self, name: str) -> Any:
        """Return a parameter's value, or the tree below this name; None if there is none. "/" is the tree of all."""
        ...

    def set_parameter(self, name: str, value: Any, require_time: Callable[[], None]) -> None:
        """Set a parameter. Raises BadField for values that ROS cannot carry. `require_time`: as for `call`."""
        ...

    def delete_parameter(self, name: str, require_time: Callable[[], None]) -> None:
        """Delete a parameter that exists, or the tree below it. `require_time`: as for `call`."""
        ...
