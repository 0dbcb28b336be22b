"""The order of what a tap tells its readers."""

from __future__ import annotations

import msgspec

from robots.bridge.tap.arrivals import Arrival, Kind, Publisher
from robots.bridge.tap.tap_server import TapServer
from robots.shared import wire
from robots.shared.configuration.bridge_config import LinkAddress
from robots.shared.wire import Refusal, TapState, TapWant, TapWants


class Socket:
    """The connection of one web process."""

    def __init__(self) -> None:
        self.sent: list[str | bytes] = []

    async def send(self, message: str | bytes, text: bool = False) -> None:
        self.sent.append(message)


async def test_a_late_word_of_silence_leaves_a_topic_its_type(tmp_path):
    server = TapServer(LinkAddress(unix_path=str(tmp_path / "tap.sock")), lambda _: None, lambda: None)
    readers = server.connected(socket := Socket())
    server.processes.add(readers)
    readers.take(wire.encode(TapWants({"/map": {"raw": TapWant()}})))

    kind = Kind("nav_msgs/OccupancyGrid", "0" * 32)
    server.inbox.put(Arrival("/map", Publisher(0, kind, True, "", {}, None), 1, 0, b"map"))
    server.take_arrivals()
    server.report(TapState("/map", refusal=Refusal("no_publisher", "Nobody publishes.", "robot")))
    await readers.send_waiting()

    state, message = socket.sent
    assert msgspec.json.decode(state, type=TapState).type == kind.type
    assert bytes(wire.untapped(message)[1]) == b"map"
