"""A tap of a real rosmaster for tests."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

from robots.bridge.served.client import TAP
from robots.shared import wire
from tests.processes import PATIENCE_S, until
from tests.ros.served import ServedProcess
from tests.ros.support import Master


class Tap(ServedProcess):
    """One tap, and a web process's connection to it."""

    def __init__(self, master: Master, folder: Path) -> None:
        self.messages: deque[tuple[wire.TapHeader, bytes]] = deque(maxlen=2000)
        self.states: dict[tuple[str, str | None], wire.TapState] = {}
        self.typed: dict[str, bool] = {}  # whether each message came after its topic's state
        super().__init__(TAP, master, folder)

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


@pytest.fixture(scope="module")
def tap(rosmaster, ros, tmp_path_factory) -> Iterator[Tap]:
    process = Tap(rosmaster, tmp_path_factory.mktemp("tap"))
    yield process
    process.stop()
