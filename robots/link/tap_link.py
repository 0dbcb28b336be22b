"""The web process's connection to a robot's tap, open while a program reads topics through this web process."""

from __future__ import annotations

from typing import Protocol

import msgspec

from robots.link.client import BridgeLink
from robots.link.process_link import ProcessLink
from robots.shared import wire
from robots.shared.wire import LARGEST_TAPPED, TAP_PING_S, Refusal, TapHeader, TapState, TapWants

STARTING = Refusal("tap_starts", "The process that reads topics starts: wait a moment.", "robot")

_state = msgspec.json.Decoder(TapState)


class TapListener(Protocol):
    """Receives messages of topics. Called on the event loop; must not block."""

    def on_tapped(self, header: TapHeader, body: memoryview) -> None:
        """Receive a message."""

    def on_tap_state(self, state: TapState) -> None:
        """Receive what a topic's publishers say of it, or why no messages come."""

    def on_tap_gone(self, refusal: Refusal) -> None:
        """Note that there is no connection to the tap, and why."""


class TapLink(ProcessLink):
    """The connection for one robot."""

    ping_s = TAP_PING_S
    max_size = LARGEST_TAPPED

    def __init__(self, link: BridgeLink, listener: TapListener) -> None:
        self._listener = listener
        super().__init__(link, "tap", TapWants({}), STARTING)

    def received(self, message: str | bytes) -> None:
        if isinstance(message, bytes):
            self._listener.on_tapped(*wire.untapped(message))
        else:
            self._listener.on_tap_state(_state.decode(message))

    def gone(self, refusal: Refusal) -> None:
        self._listener.on_tap_gone(refusal)
