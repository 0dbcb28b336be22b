"""The watchdog's socket and state file, and the bridge's side: with watchdogs in turn, and in parallel."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from uuid import uuid4

import msgspec
import pytest

from robots.bridge.lease.state_store import SavedState, StateStore
from robots.bridge.watchdog.client import MISSING_S, WatchdogClient
from robots.bridge.watchdog.rules import Heartbeat, StopPress, StopRules
from robots.bridge.watchdog.socket import ReceivedMessage, WatchdogSocket
from robots.bridge.watchdog.stop_file import StopFile
from robots.shared import wire

PATIENCE_S = 10.0


@pytest.fixture
def open_lane(tmp_path: Path) -> Iterator[Callable[[], WatchdogSocket]]:
    """Open a socket at the robot's path."""
    opened: list[WatchdogSocket] = []

    def begin() -> WatchdogSocket:
        opened.append(WatchdogSocket(str(tmp_path / "robot.stop")))
        return opened[-1]

    yield begin
    opened[-1].close()


async def said(lane: WatchdogSocket) -> ReceivedMessage:
    """The next message."""
    while not (heard := await asyncio.to_thread(lane.wait, PATIENCE_S)):
        pass
    return heard[0]


def test_late_ending_watchdog_leaves_the_next_ones_socket(
    tmp_path: Path, open_lane: Callable[[], WatchdogSocket]
) -> None:
    first, _next = open_lane(), open_lane()
    first.close()
    assert (tmp_path / "robot.stop").is_socket()


def test_a_watchdog_that_ends_removes_its_socket(tmp_path: Path) -> None:
    WatchdogSocket(str(tmp_path / "robot.stop")).close()
    assert not (tmp_path / "robot.stop").exists()


async def test_stops_with_lower_numbers_of_a_new_watchdog_are_heard(
    tmp_path: Path, open_lane: Callable[[], WatchdogSocket]
) -> None:
    """The clock was set back between the two watchdogs."""
    presses: asyncio.Queue[StopPress] = asyncio.Queue()
    beats = WatchdogClient(str(tmp_path / "robot.stop"), presses.put_nowait, lambda _: None)
    for number in (100, 50):
        lane = open_lane()
        beats.beat(Heartbeat(), 0.0)
        connection, _ = await said(lane)
        lane.send(connection, wire.encode(StopPress(number, "Ann")))
        press = await asyncio.wait_for(presses.get(), PATIENCE_S)
        assert press.number == number
        beats.heard(number)
        beats.beat(Heartbeat(), 0.0)
        _, message = await said(lane)
        assert message is not None and msgspec.json.decode(message, type=Heartbeat).heard == number
        if number == 100:
            lane.close()
            beats.beat(Heartbeat(), 0.0)  # cannot be sent: no watchdog is there
    beats.close()


async def test_stop_that_the_bridge_failed_on_is_sent_again(
    tmp_path: Path, open_lane: Callable[[], WatchdogSocket]
) -> None:
    """Otherwise the watchdog would stop the robot for ever, and the bridge would not know it."""
    presses: asyncio.Queue[StopPress] = asyncio.Queue()
    broken = asyncio.Event()

    def hear(press: StopPress) -> None:
        if not broken.is_set():
            broken.set()
            raise RuntimeError("broken")
        presses.put_nowait(press)

    asyncio.get_running_loop().set_exception_handler(lambda *_: None)
    beats, lane = WatchdogClient(str(tmp_path / "robot.stop"), hear, lambda _: None), open_lane()
    beats.beat(Heartbeat(), 0.0)
    connection, _ = await said(lane)
    for _ in range(2):
        lane.send(connection, wire.encode(StopPress(100, "Ann")))
        await asyncio.wait_for(broken.wait(), PATIENCE_S)
    assert (await asyncio.wait_for(presses.get(), PATIENCE_S)).number == 100
    beats.close()


async def test_a_cleared_stop_is_over_although_the_disk_has_not_taken_it(
    tmp_path: Path, open_lane: Callable[[], WatchdogSocket]
) -> None:
    """Otherwise the watchdog would go on with zeros and cancels, and end what begins after the clear."""
    presses: asyncio.Queue[StopPress] = asyncio.Queue()
    beats, lane = (
        WatchdogClient(str(tmp_path / "robot.stop"), presses.put_nowait, lambda _: None),
        open_lane(),
    )
    rules = StopRules(first=100)
    rules.bridge_came(0.0)
    beats.beat(Heartbeat(publishing=True), 0.0)
    connection, _ = await said(lane)
    lane.send(connection, wire.encode(rules.press("Ann", "")))
    await asyncio.wait_for(presses.get(), PATIENCE_S)
    for latched in (True, False):
        beats.beat(Heartbeat(publishing=True, latched=latched), 0.0)
        _, message = await said(lane)
        assert message is not None
        rules.beat(msgspec.json.decode(message, type=Heartbeat), 0.0)
        assert rules.zeros(0.0) == rules.cancel(0.0) == latched
    beats.close()


def test_saved_stop_survives_and_a_damaged_file_is_a_stop(tmp_path: Path) -> None:
    robot = uuid4()
    kept = StopFile(str(tmp_path), robot)
    kept.start()
    kept.keep(StopPress(100, "Ann", "smoke"))
    end_s = time.monotonic() + PATIENCE_S
    while not (found := list(tmp_path.glob("*.pressed"))):
        assert time.monotonic() < end_s
        time.sleep(0.01)
    assert StopFile(str(tmp_path), robot).load() == StopPress(100, "Ann", "smoke")
    for content in (b"\0" * 100, b'{"t": "press", "number": 1, "by": "\xff"}'):
        found[0].write_bytes(content)
        damaged = StopFile(str(tmp_path), robot).load()
        assert damaged is not None and damaged.by == "somebody"


def test_latch_in_the_state_file_is_not_an_unheard_stop(tmp_path: Path) -> None:
    robot = uuid4()
    StateStore(tmp_path, str(robot)).save(SavedState(True, "Ann", "smoke", 3))
    kept = StopFile(str(tmp_path), robot)
    assert kept.load() is None
    assert kept.before() == Heartbeat(latched=True, by="Ann", reason="smoke")


async def test_watchdog_without_reading_is_missing_after_seconds(
    tmp_path: Path, open_lane: Callable[[], WatchdogSocket]
) -> None:
    beats = WatchdogClient(str(tmp_path / "robot.stop"), lambda _: None, lambda _: None)
    assert not beats.missing(0.0)  # no heartbeat was sent yet
    beats.beat(Heartbeat(), 100.0)  # no watchdog is there
    assert not beats.missing(100.0 + MISSING_S)
    assert beats.missing(100.1 + MISSING_S)
    lane = open_lane()
    beats.beat(Heartbeat(), 110.0)
    assert not beats.missing(110.0 + MISSING_S)
    now_s = 110.0
    while not beats.missing(now_s):  # the watchdog is frozen: its socket's buffer gets full
        assert now_s < 200.0
        now_s += 0.05
        beats.beat(Heartbeat(), now_s)
    lane.close()
    beats.close()
