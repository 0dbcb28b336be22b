"""A tap in its own process, for tests of each ROS."""

from __future__ import annotations

from collections import deque

import msgspec

from robots.bridge.served.client import TAP
from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from tests.processes import PATIENCE_S, until
from tests.served import ServedProcess


class Tap(ServedProcess):
    """One tap, and a web process's connection to it."""

    def __init__(self, config: BridgeConfig, environment: dict[str, str]) -> None:
        self.messages: deque[tuple[wire.TapHeader, bytes]] = deque(maxlen=2000)
        self.states: dict[tuple[str, str | None], wire.TapState] = {}
        self.typed: dict[str, bool] = {}  # whether each message came after its topic's state
        super().__init__(TAP, config, environment)

    def want(self, **topics: str | wire.TapWant) -> None:
        """Ask for these topics: ``scan="json"``; forms are separated by blanks."""
        wants = {
            f"/{topic}": {form: wire.TapWant() for form in forms.split()} for topic, forms in topics.items()
        }
        self.say(wire.TapWants(wants))

    def received(self, message: str | bytes) -> None:
        if isinstance(message, bytes):
            header, body = wire.untapped(message)
            self.typed[header.topic] = (
                self.typed.get(header.topic, True) and (header.topic, None) in self.states
            )
            self.messages.append((header, bytes(body)))
        else:
            state = msgspec.json.decode(message, type=wire.TapState)
            self.states[state.topic, state.form] = state

    def of(self, topic: str, form: str) -> list[bytes]:
        return [body for header, body in self.messages if (header.topic, header.form) == (f"/{topic}", form)]

    def hears(self, topic: str, form: str = "json") -> bytes:
        until(lambda: self.of(topic, form), f"{topic} as {form}: {self.states}", PATIENCE_S)
        return self.of(topic, form)[-1]

    def refuses(self, topic: str, code: str, form: str | None = None) -> wire.Refusal:
        def refused() -> wire.Refusal | None:
            state = self.states.get((f"/{topic}", form))
            return state.refusal if state and state.refusal and state.refusal.code == code else None

        return until(refused, f"{topic}: {code}; {self.states}", PATIENCE_S)
