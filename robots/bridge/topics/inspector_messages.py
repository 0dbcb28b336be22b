"""Messages between bridge and inspector: one JSON line each."""

from __future__ import annotations

import time

from msgspec import Struct

from robots import wire
from robots.wire import Refusal


class TooLate(Exception):
    """Nobody waits for the answer any more: what was asked for must not be done."""


class InspectorQuery(Struct, frozen=True, tag_field="t", tag="inspect"):
    """A viewer's question, until its asker is told that there is no answer. Answer: `wire.LinkAnswer`."""

    seq: int
    ask: wire.TopicQuery
    until_s: float | None = None  # by the monotonic clock, which all processes of a machine share

    def require_time(self) -> None:
        """Before anything is done. Raises `TooLate`."""
        if self.until_s is not None and time.monotonic() >= self.until_s:
            raise TooLate


class Check(Struct, frozen=True, tag_field="t", tag="check"):
    """Do the fields of this order fit its definition? Answer: `Done`."""

    number: int
    order: wire.Publish


class HaltPublishing(Struct, frozen=True, tag_field="t", tag="silence"):
    """Publish no more there; None: nothing of what was given until now, also of what waits. Answer: `Done`."""

    number: int
    topic: str | None = None


class KeepAlive(Struct, frozen=True, tag_field="t", tag="alive"):
    """The bridge is there: go on with what is published at a rate."""


Request = InspectorQuery | wire.LinkSubscribe | Check | wire.Publish | HaltPublishing | KeepAlive


class Ready(Struct, frozen=True, tag_field="t", tag="ready"):
    """The inspector's first word."""


class Done(Struct, frozen=True, tag_field="t", tag="done"):
    """The result of request `number`: done, or the refusal."""

    number: int
    refusal: Refusal | None = None


Report = Ready | Done | wire.LinkAnswer | wire.LinkSample
