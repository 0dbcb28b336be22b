"""Drive lanes: commands reach a bridge on the same computer in order, for their own link only."""

from __future__ import annotations

import asyncio
import os
import socket
import stat
import time
import uuid

import pytest

from robots.bridge.server.link_server import LinkServer
from robots.link.client import BridgeLink
from robots.shared import wire
from robots.shared.configuration.bridge_config import LinkAddress
from robots.shared.link.lane import lane_path
from tests.bridge.support import CONFIG, Bench

PATIENCE_S = 10.0


class Bridge:
    """A link server that stores each message, and whether it arrived by lane or by socket."""

    def __init__(self, path: str) -> None:
        self.bench = Bench().online()
        self.heard: list[tuple[str, wire.LinkRequest]] = []
        self.closed = asyncio.Event()
        self.news = asyncio.Condition()
        self.server = LinkServer(
            LinkAddress(unix_path=path), self._opened, self._received, self._closed, self._quick
        )

    def _opened(self, link):
        link.report(self.bench.core.hello())

    def _closed(self, _link):
        self.closed.set()

    async def _received(self, _link, raw):
        self._note("socket", raw)

    def _quick(self, link, raw):
        self._note("lane", raw)
        message = wire.link_request(raw)
        if isinstance(message, wire.LinkStop):
            link.report(wire.Stopped(wire.StopState("stopping", message.by), message.seq))

    def _note(self, way, raw):
        self.heard.append((way, wire.link_request(raw)))

    async def until(self, condition):
        end_s = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < end_s
            await asyncio.sleep(0.005)


def drive(seq: int) -> str:
    return wire.encode(wire.Drive(fence=2, seq=seq, sent_ms=0.0, x=0.1, w=0.0)).decode()


@pytest.fixture
async def bridge(tmp_path):
    found = Bridge(str(tmp_path / "bridge.sock"))
    await found.server.start()
    yield found
    await found.server.close()


@pytest.fixture
async def link(bridge, tmp_path):
    found = BridgeLink(uuid.UUID(CONFIG.robot_id), LinkAddress(unix_path=str(tmp_path / "bridge.sock")))
    await bridge.until(lambda: any(each.lane for each in bridge.server.links))
    yield found
    await found.close()


async def test_a_command_takes_the_lane_and_everything_else_the_socket(bridge, link):
    assert await link.forward(drive(1))
    link.send(wire.Pause(2, "The page is gone."))
    await bridge.until(lambda: len(bridge.heard) >= 3)
    ways = {type(message): way for way, message in bridge.heard}
    assert ways == {wire.LinkHello: "socket", wire.Drive: "lane", wire.Pause: "socket"}


async def test_a_stop_takes_the_lane_and_its_answer_the_socket(bridge, link):
    stopped = await link.stop(wire.LinkStop("Ann"))
    assert isinstance(stopped, wire.Stopped)
    assert [way for way, message in bridge.heard if isinstance(message, wire.LinkStop)] == ["lane"]


async def test_the_word_that_ends_control_overtakes_no_command(bridge, link):
    """If the end of control arrived first, a late command would move the robot."""
    for seq in range(20):
        assert await link.forward(drive(seq))
    link.send(wire.Pause(2, "The page is gone."))
    await bridge.until(lambda: any(isinstance(message, wire.Pause) for _, message in bridge.heard))
    heard = [message for _, message in bridge.heard if not isinstance(message, wire.LinkHello)]
    assert [getattr(message, "seq", "pause") for message in heard] == [*range(20), "pause"]


async def test_slow_bridge_reads_only_few_commands_late(bridge, link):
    sent = 0
    while await link.forward(drive(sent)):  # nobody reads: the bridge runs in this event loop, too
        sent += 1
        assert sent < 100
    await bridge.until(lambda: len(bridge.heard) == sent + 1)
    assert await link.forward(drive(sent))


async def test_the_end_of_the_lane_is_the_end_of_the_link(bridge, link):
    [end] = bridge.server.links
    link._lane.close()
    await asyncio.wait_for(bridge.closed.wait(), PATIENCE_S)
    assert end.lane is not None
    # The bridge makes a new lane
    await bridge.until(lambda: bridge.server.links and end not in bridge.server.links)


async def test_a_bridge_that_ends_the_lane_ends_the_link(bridge, link):
    [end] = bridge.server.links
    end.lane.close()
    await asyncio.wait_for(bridge.closed.wait(), PATIENCE_S)


async def test_the_end_of_the_socket_is_the_end_of_the_lane(bridge, link):
    lane = link._lane
    [end] = bridge.server.links
    end.cut()
    await bridge.until(lambda: link._lane is not lane)
    assert not lane.send(b"{}")


async def test_lane_with_an_unknown_token_is_refused(bridge, link, tmp_path):
    path = lane_path(str(tmp_path / "bridge.sock"))
    assert stat.S_IMODE(os.stat(path).st_mode) == 0o600
    heard = len(bridge.heard)
    for token in (b"guessed", b"\xff\xfe"):
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as stranger:
            stranger.connect(path)
            stranger.send(token)
            stranger.send(drive(7).encode())
            stranger.setblocking(False)
            await asyncio.wait_for(closed(stranger), PATIENCE_S)
    assert len(bridge.heard) == heard
    assert await link.forward(drive(1))


async def closed(stranger: socket.socket) -> None:
    """Wait until the other side has closed."""
    try:
        while await asyncio.get_running_loop().sock_recv(stranger, 1):
            pass
    except ConnectionResetError:
        pass


async def test_a_message_that_breaks_the_bridge_ends_its_link(bridge, link):
    link._lane.send(b"not a message")  # an error in this fake bridge; the real one refuses it
    await asyncio.wait_for(bridge.closed.wait(), PATIENCE_S)
