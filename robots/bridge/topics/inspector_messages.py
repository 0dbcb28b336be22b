"""Messages between the bridge and its inspector: one JSON line each."""

from __future__ import annotations

import time

from msgspec import Struct

from robots.bridge.robot_clock import RobotClock
from robots.shared import wire
from robots.shared.wire import Refusal


class TooLate(Exception):
    """The requester's time limit is over: the request must not be carried out."""


class InspectorQuery(Struct, frozen=True, tag_field="t", tag="inspect"):
    """A viewer's query, with its time limit. Answer: `wire.LinkAnswer`."""

    seq: int
    ask: wire.TopicQuery | wire.DoorQuery
    until_s: float | None = None  # monotonic clock, which all processes of a computer share

    def require_time(self) -> None:
        """Check the time limit before acting. Raises `TooLate`."""
        if self.until_s is not None and time.monotonic() >= self.until_s:
            raise TooLate


class Check(Struct, frozen=True, tag_field="t", tag="check"):
    """Check whether the fields of this message fit its definition. Answer: `Done`."""

    number: int
    order: wire.Publish


class HaltPublishing(Struct, frozen=True, tag_field="t", tag="halt_publishing"):
    """Stop publishing on this topic; None: on all, including waiting messages. Answer: `Done`."""

    number: int
    topic: str | None = None


class KeepAlive(Struct, frozen=True, tag_field="t", tag="alive"):
    """The bridge runs: continue to publish at a rate."""


class FollowClock(Struct, frozen=True, tag_field="t", tag="clock"):
    """The robot's clock, by which messages get their age."""

    clock: RobotClock


Request = (
    InspectorQuery | wire.LinkSubscribe | Check | wire.Publish | HaltPublishing | KeepAlive | FollowClock
)


class Ready(Struct, frozen=True, tag_field="t", tag="ready"):
    """The inspector's first message."""


class Done(Struct, frozen=True, tag_field="t", tag="done"):
    """The result of request `number`: done, or refused."""

    number: int
    refusal: Refusal | None = None


Report = Ready | Done | wire.LinkAnswer | wire.LinkSample
