"""The event loop of a bridge: commands go before other work, and ticks are on time."""

from __future__ import annotations

import asyncio
import time

import pytest
from msgspec import structs

from robots.bridge.lease.state_store import SavedState, StateStore
from robots.bridge.process import Bridge
from robots.shared.configuration.bridge_config import LinkAddress
from robots.shared.wire import Grant
from tests.bridge.support import CONFIG, MemorySink


@pytest.fixture
async def bridge(tmp_path):
    store = StateStore(tmp_path, CONFIG.robot_id)
    store.lock()
    store.save(SavedState(False, "", "", 0))
    config = structs.replace(CONFIG, link=LinkAddress(unix_path=str(tmp_path / "bridge.sock")))
    yield Bridge(config, MemorySink(), store)
    store.unlock()


async def test_ticks_are_seldom_without_control_until_it_begins(bridge):
    assert bridge._may_rest(time.monotonic())
    bridge._rests = True
    bridge._core.grant(Grant(1, 60.0, "session", "Ann", "ann-id", 1.0), 1, time.monotonic())
    assert not bridge._may_rest(time.monotonic())
    bridge._changed()
    assert bridge._wake.is_set(), "control begins without waiting for a tick"


async def test_ticks_are_frequent_while_a_stop_is_latched(bridge):
    bridge._rests = True
    bridge._core.stop("Ann", "", time.monotonic())
    bridge._changed()
    assert bridge._wake.is_set(), "zeros are repeated from now on"
    bridge._wake.clear()
    bridge._changed()
    assert not bridge._wake.is_set(), "a flood of stops costs no ticks"


async def test_the_watchdog_hears_of_twists_whoever_listens(bridge, monkeypatch):
    """A stranger may hide who listens: if the bridge dies, the watchdog must send zeros all the same."""
    beats = []
    monkeypatch.setattr(bridge._watchdog, "beat", lambda beat, _now_s: beats.append(beat))
    bridge._core.stop("Ann", "", time.monotonic())
    assert not bridge._base.listeners
    bridge._beat(time.monotonic())
    assert beats[-1].publishing and not beats[-1].listened


async def test_a_robot_at_rest_under_control_gets_zeros_between_ticks(bridge, monkeypatch):
    done, core = [], bridge._core

    def beat(_now_s):
        done.append("beat")
        if "zero" in done and done[-2] == "tick":
            bridge._end()

    monkeypatch.setattr(type(core), "rests", True)
    monkeypatch.setattr(type(core), "in_use", True)
    monkeypatch.setattr(core, "repeat_zero", lambda *_: done.append("zero"))
    monkeypatch.setattr(bridge, "_tick", lambda *_: done.append("tick"))
    monkeypatch.setattr(bridge, "_beat", beat)
    monkeypatch.setattr(bridge._base.mail, "take_waiting", lambda: done.append("mail"))
    await asyncio.wait_for(bridge._tick_until_ended(), 30.0)
    ticks = [done[n + 1] for n, what in enumerate(done) if what in ("tick", "zero")]
    assert set(ticks) == {"beat"}, "the watchdog hears of each"
    assert "mail" in done[:3], "messages are taken before the first tick"
    assert done.count("zero") < 4, "a tick comes every fifth of a second, whatever is late"


async def test_command_between_two_pieces_of_work_goes_first(bridge, monkeypatch):
    inbox, done = [], []

    def read_lanes():
        done.extend(inbox)
        inbox.clear()

    def scan():
        done.append("scan")
        inbox.append("command")

    def sonar():
        done.append("sonar")
        bridge._soon(picture)  # a piece of work adds other work
        bridge._soon(picture)
        inbox.append("second command")

    def picture():
        done.append("picture")

    monkeypatch.setattr(bridge._links, "read_lanes", read_lanes)
    for piece in (scan, sonar, sonar):
        bridge._soon(piece)
    await asyncio.sleep(0.01)
    assert done == ["scan", "command", "sonar", "second command", "picture"]


async def test_work_is_done_even_if_earlier_commands_failed(bridge, monkeypatch):
    done = []
    monkeypatch.setattr(bridge._links, "read_lanes", lambda: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        bridge._after_commands(lambda: done.append(1))
    assert done == [1]
