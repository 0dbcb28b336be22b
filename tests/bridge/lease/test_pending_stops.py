"""A stop without confirmation stays pending for bridge or watchdog, whichever process received it."""

from __future__ import annotations

import asyncio
import stat
import threading
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from uuid import UUID, uuid4

import pytest
import pytest_asyncio
from django.conf import settings

from robots.bridge.lease.state_store import SavedState
from robots.bridge.process import initial_state
from robots.bridge.server.link_server import Link, LinkServer
from robots.link import stop_courier as courier
from robots.link.client import BridgeLink
from robots.shared import wire
from robots.shared.configuration.bridge_config import LinkAddress
from robots.shared.link.pending_stops import FOLDER, PendingStops, WaitingStop, name_of
from teleop.stop.presses import Pending, press_at
from tests.bridge.support import CONFIG, Bench

ROBOT = UUID(CONFIG.robot_id)
PATIENCE_S = 10.0


@pytest.fixture(autouse=True)
def run_dir(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A run folder for this test only."""
    monkeypatch.setattr(settings, "FLEET_RUN_DIR", tmp_path)
    yield tmp_path
    for stop in courier.pending_stops().all():  # this test's courier ends when no stop is pending
        courier.pending_stops().settle(stop, wire.Refusal("over", "The test is over.", "wire"))


@pytest.fixture
def address(run_dir: Path) -> LinkAddress:
    return LinkAddress(unix_path=str(run_dir / f"{name_of(ROBOT)}.sock"))


class Bridge:
    """A bridge that stores its messages in order."""

    def __init__(self, address: LinkAddress) -> None:
        self.bench = Bench().online()
        self.heard: list[wire.LinkRequest] = []
        self.frozen = False
        self.server = LinkServer(
            address, self.opened, lambda link, raw: self.received(link, raw), lambda _link: None
        )

    def opened(self, link: Link) -> None:
        link.report(self.bench.core.hello())

    async def received(self, link: Link, raw: bytes) -> None:
        if self.frozen:
            return
        message = wire.link_request(raw)
        self.heard.append(message)
        match message:
            case wire.LinkHello():
                link.report(wire.Status(self.bench.core.state(self.bench.now_s, [])))
            case wire.LinkStop(by=by, reason=reason, press=pressed):
                self.bench.core.stop(by, reason, self.bench.now_s, pressed)
                link.report(wire.Stopped(self.bench.core.stop_state, message.seq, pressed))
            case wire.LinkClear(number=number, presses=presses):
                assert self.bench.core.clear(number, self.bench.now_s, presses) is None
                link.report(wire.Stopped(self.bench.core.stop_state, message.seq))

    @property
    def stop(self) -> wire.StopState:
        return self.bench.core.stop_state


@pytest_asyncio.fixture
async def bridge(address: LinkAddress) -> AsyncIterator[Bridge]:
    """A bridge that is not started yet."""
    bridge = Bridge(address)
    yield bridge
    await bridge.server.close()
    bridge.bench.close()


def waiting(run_dir: Path) -> list[Path]:
    return sorted((run_dir / FOLDER).glob("*.json"))


async def until(condition: Callable[[], object], what: str) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end_s, what
        await asyncio.sleep(0.02)


@asynccontextmanager
async def open_link(address: LinkAddress, stops: PendingStops) -> AsyncIterator[BridgeLink]:
    """A link to the running bridge, closed at the end."""
    link = BridgeLink(ROBOT, address, stops)
    try:
        await until(lambda: link.up, "the link is up")
        yield link
    finally:
        await link.close()


async def press_in_other_process(address: LinkAddress) -> Pending:
    """Press stop as another process does, without an answer and without a courier."""
    [pending] = await asyncio.to_thread(press_at, [(ROBOT, address)], "Ann", "smoke")
    assert isinstance(pending, Pending)
    return pending


async def test_stop_without_a_bridge_waits_and_stops_the_next_bridge(
    address: LinkAddress, bridge: Bridge, run_dir: Path
) -> None:
    pending = await press_in_other_process(address)
    assert pending.refusal.code == "pending"
    assert pending.refusal.figures == {"because": "bridge_down"}
    (path,) = waiting(run_dir)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700
    await bridge.server.start()
    stopped = await asyncio.wait_for(asyncio.wrap_future(pending.outcome), PATIENCE_S)
    assert isinstance(stopped, wire.Stopped)
    assert (bridge.stop.by, bridge.stop.reason) == ("Ann", "smoke")
    assert waiting(run_dir) == []


def test_a_bridge_begins_latched_while_a_stop_waits_for_it() -> None:
    stop = WaitingStop(name_of(ROBOT), uuid4(), ROBOT, "Ann", "smoke")
    left = SavedState(False, "", "", 7)
    assert initial_state([], left) == (left, [])
    assert initial_state([stop], left) == (SavedState(True, "Ann", "smoke", 7), [stop.press])


async def test_a_link_says_a_waiting_stop_first(address: LinkAddress, bridge: Bridge, run_dir: Path) -> None:
    stops = PendingStops(run_dir)
    stop = WaitingStop(name_of(ROBOT), uuid4(), ROBOT, "Ann", "smoke")
    assert stops.keep(stop)
    await bridge.server.start()
    link = BridgeLink(ROBOT, address, stops)
    try:
        await until(lambda: not waiting(run_dir), "the stop is delivered")
        assert bridge.heard[0] == stop.message()
        assert bridge.stop.by == "Ann"
    finally:
        await link.close()


async def test_open_link_delivers_pending_stops_of_other_processes(
    address: LinkAddress, bridge: Bridge, run_dir: Path
) -> None:
    await bridge.server.start()
    async with open_link(address, PendingStops(run_dir)):
        PendingStops(run_dir).keep(WaitingStop(name_of(ROBOT), uuid4(), ROBOT, "Ann", "smoke"))
        await until(lambda: not waiting(run_dir), "the stop is delivered")
        assert bridge.stop.by == "Ann"


async def test_woken_bridge_stops_once_for_a_press_by_all_ways(
    address: LinkAddress, bridge: Bridge, run_dir: Path
) -> None:
    await bridge.server.start()
    async with open_link(address, courier.pending_stops()):
        bridge.frozen = True
        before = bridge.stop.number
        pending = await press_in_other_process(address)
        assert pending.refusal.figures == {"because": "bridge_silent"}
        bridge.frozen = False
        await asyncio.wait_for(asyncio.wrap_future(pending.outcome), PATIENCE_S)
        assert (bridge.stop.state, bridge.stop.number) == ("stopping", before + 1)


async def test_pending_stop_does_not_stop_again_after_a_clear(
    address: LinkAddress, bridge: Bridge, run_dir: Path
) -> None:
    await bridge.server.start()
    stops = PendingStops(run_dir)
    async with open_link(address, stops) as link:
        await link.stop(wire.LinkStop("Ben"))
        stop = WaitingStop(name_of(ROBOT), uuid4(), ROBOT, "Ann", "smoke")
        stops.keep(stop)  # as another process does, which is also delivering the stop
        cleared = await link.clear(wire.LinkClear("Ben", bridge.stop.number), asked_s=time.time())
        assert cleared.stop.state == "clear"
        assert waiting(run_dir) == []
        assert isinstance(await link.stop(stop.message()), wire.Stopped)
        assert bridge.stop.state == "clear"


async def test_a_press_after_the_click_on_clear_stays_pending(
    address: LinkAddress, bridge: Bridge, run_dir: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("robots.link.client.WAITING_PACE_S", 60.0)  # no delivery before the clear
    await bridge.server.start()
    stops = PendingStops(run_dir)
    async with open_link(address, stops) as link:
        await link.stop(wire.LinkStop("Ben"))
        clicked_s = time.time()
        stop = WaitingStop(name_of(ROBOT), uuid4(), ROBOT, "Ann", "smoke", at=clicked_s + 0.1)
        stops.keep(stop)
        await link.clear(wire.LinkClear("Ben", bridge.stop.number), asked_s=clicked_s)
        assert stops.of(stop.name) == [stop]
        assert isinstance(await link.stop(stop.message()), wire.Stopped)
        assert bridge.stop.state == "stopping"


def test_newest_press_of_a_robot_counts(run_dir: Path) -> None:
    stops, robot, other = PendingStops(run_dir), uuid4(), uuid4()
    first, second = (
        WaitingStop(name_of(robot), uuid4(), robot, by, at=at) for by, at in (("Ann", 1.0), ("Ben", 2.0))
    )
    elsewhere = WaitingStop(name_of(other), uuid4(), other, "Eve", at=1.5, host="bridge.example", port=4)
    for stop in (first, elsewhere, second):
        stops.keep(stop)
    assert stops.all() == [elsewhere, second]
    assert PendingStops(run_dir).of(second.name) == [second]
    stops.settle(second, wire.Stopped(wire.StopState("stopping")))
    assert stops.all() == [elsewhere]


def test_unwritable_stop_waits_in_this_process(run_dir: Path, caplog: pytest.LogCaptureFixture) -> None:
    (run_dir / FOLDER).touch()  # a file, not a folder: writing fails, as on a full disk
    stops, answered = PendingStops(run_dir), threading.Event()
    stop = WaitingStop("0123456789ab", uuid4(), None, "Ann")
    assert not stops.keep(stop, lambda _answer: answered.set())
    assert "waits in this process alone" in caplog.text
    assert stops.of(stop.name) == [stop]
    stops.settle(stop, wire.Stopped(wire.StopState("stopping")))
    assert stops.all() == [] and answered.is_set()


def test_unwritable_stop_leaves_an_older_one_on_disk(run_dir: Path) -> None:
    """The newer stop is lost when this process ends; the older one remains."""
    stops, robot = PendingStops(run_dir), uuid4()
    older, newer = (WaitingStop(name_of(robot), uuid4(), robot, "Ann", at=at) for at in (1.0, 2.0))
    assert stops.keep(older)
    (run_dir / FOLDER / f"{newer.name}-{newer.press.hex}.new").mkdir()  # writing fails
    assert not stops.keep(newer)
    assert stops.of(older.name) == [older, newer]
    assert PendingStops(run_dir).of(older.name) == [older], "another process must find it"
    stops.settle(newer, wire.Stopped(wire.StopState("stopping")))
    assert stops.all() == []


async def test_a_disk_that_hangs_keeps_no_link_from_coming_up(
    address: LinkAddress, bridge: Bridge, run_dir: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = threading.Event()
    stops = PendingStops(run_dir)
    monkeypatch.setattr(stops, "of", lambda _name: answers.wait() and [])
    await bridge.server.start()
    link = BridgeLink(ROBOT, address, stops)
    try:
        await until(lambda: link.up, "the link is up")
    finally:
        answers.set()
        await link.close()


@pytest.mark.parametrize("content", [b"\0" * 100, b'{"name":"\xff"}'])
def test_a_damaged_file_is_a_stop_all_the_same(run_dir: Path, content: bytes) -> None:
    stops, stop = PendingStops(run_dir), WaitingStop("0123456789ab", uuid4(), None, "Ann")
    stops.keep(stop)
    (path,) = waiting(run_dir)
    path.write_bytes(content)
    (found,) = stops.all()
    assert (found.name, found.press) == (stop.name, stop.press)
    (run_dir / FOLDER / "what.json").touch()
    assert len(stops.all()) == 1


async def test_a_stop_that_the_bridge_refuses_waits_no_more(
    address: LinkAddress, bridge: Bridge, run_dir: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def refuse(link: Link, _raw: bytes) -> None:
        link.report(wire.Refused("link_stop", wire.Refusal("other_robot", "Another one’s.", "robot")))

    pending = await press_in_other_process(address)
    monkeypatch.setattr(bridge, "received", refuse)
    await bridge.server.start()
    refused = await asyncio.wait_for(asyncio.wrap_future(pending.outcome), PATIENCE_S)
    assert isinstance(refused, wire.Refusal) and refused.code == "other_robot"
    assert waiting(run_dir) == []
