"""The tap of a robot, whose messages the test makes."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Mapping
from typing import Any

import cbor2
import msgspec

from robots.bridge.tap.arrivals import Arrival, Kind, Publisher
from robots.bridge.tap.tap_server import TapServer
from robots.registry.models import Robot
from robots.registry.selectors import link_address
from robots.shared.wire import LinkProcess, TapState
from tests.teleop.support import FakeBridge

WORDS = Kind("std_msgs/String", "992ce8a1687cec8c8bd883ec73ca41d1")


class FakeTap:
    """Its messages are JSON: `json` passes them on, `cbor` encodes them, `raw` is the JSON, too."""

    def __init__(self, robot: Robot) -> None:
        self.wanted: Mapping[str, int] = {}
        self._numbers: dict[str, int] = {}
        self._changed = asyncio.Event()
        self._server = TapServer(link_address(robot), self._set_wanted, lambda: self._soon())

    async def start(self, bridge: FakeBridge) -> FakeTap:
        """Listen as soon as a reader needs it, and let the bridge send the address."""
        await bridge.hears(LinkProcess, lambda message: message.process == "tap" and message.wanted)
        bridge.say(await self._server.start())
        return self

    async def close(self) -> None:
        await self._server.close()

    async def until(self, holds: Callable[[Mapping[str, int]], bool]) -> None:
        """Wait until what the web process reads fits."""
        while not holds(self.wanted):
            self._changed.clear()
            await asyncio.wait_for(self._changed.wait(), 5.0)

    def describe(
        self, topic: str, kind: Kind = WORDS, definition: str = "string data\n", **fields: Any
    ) -> None:
        """Say what the topic's publishers say."""
        self._server.report(TapState(topic, kind.type, kind.md5, definition, **fields))

    def publish(self, topic: str, message: Any, *, latched: bool = False, publisher: int = 0) -> None:
        """Let one message arrive."""
        number = self._numbers[topic] = self._numbers.get(topic, 0) + 1
        encoders = {"json": bytes, "cbor": lambda data: cbor2.dumps(msgspec.json.decode(data))}
        by = Publisher(publisher, WORDS, latched, "string data\n", encoders, None)
        data = msgspec.json.encode(message)
        self._server.inbox.put(Arrival(topic, by, number, time.time_ns(), data))

    def _set_wanted(self, wanted: Mapping[str, int]) -> None:
        for topic in self.wanted.keys() - wanted.keys():
            self._server.forget(topic)
        self.wanted = wanted
        self._changed.set()

    def _soon(self) -> None:
        asyncio.get_running_loop().call_soon(self._server.take_arrivals)
