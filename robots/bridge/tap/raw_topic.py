"""A topic that a ROS side reads as bytes, with what its publishers say of them: for tap and recorder."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

from robots.bridge.tap.arrivals import Kind
from robots.shared.messages.definition import Definition
from robots.shared.wire import Refusal

MOST_PUBLISHERS = 500  # of a topic, over time


class Speaker(NamedTuple):
    """One publisher of a topic, as its connection describes it."""

    node: str
    kind: Kind
    latched: bool
    text: str  # of its definition, as it sent it
    definition: Definition | None
    refusal: Refusal | None  # why there is no definition


class RawTopic(Protocol):
    """One subscribed topic."""

    def speakers(self) -> list[Speaker]:
        """Return the publishers that are connected now."""

    def close(self) -> None:
        """Unsubscribe."""


Take = Callable[[Speaker, bytes], None]  # gets each message, on threads of the side
