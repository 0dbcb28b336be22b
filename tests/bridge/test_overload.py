"""If the computer is overloaded, the bridge reports this with numbers, once in the log; nobody is blamed."""

from __future__ import annotations

import pytest

from robots.bridge.gate.sensor_limits import Fault
from robots.shared.geometry.poses import STILL
from robots.shared.processes.overload import KEPT_S, LoopLateness
from robots.shared.wire import Overload
from tests.bridge.support import Bench


@pytest.fixture
def bench():
    bench = Bench().online()
    yield bench.granted().driving()
    bench.close()


def needed(bench):
    return bench.core.state(bench.now_s, []).neutral_needed


def stall(bench, late_s):
    """Let the bridge's loop get no processor time for `late_s`."""
    bench.now_s += late_s
    bench.odometry()
    bench.core.tick(bench.now_s, late_s)


def test_commands_unread_by_a_late_bridge_do_not_blame_operator(bench):
    stall(bench, 0.4)
    assert bench.last == STILL
    assert needed(bench).code == "overloaded"
    assert needed(bench).text == "this computer is overloaded: the bridge was 0.4 s late"
    assert bench.core.state(bench.now_s, []).overload == Overload("bridge", 0.4)


def test_odometry_that_waits_beside_a_command_is_not_silent(bench):
    bench.gate.misses = Fault("odometry_stale", "odometry is 0.3 s old", "odometry")
    bench.gate.odometry_is_stale = lambda _now_s: True
    bench.base.waiting = [lambda: setattr(bench.gate, "misses", None)]
    assert bench.stick(0.5) is None
    assert bench.last != STILL and needed(bench) is None


def test_fresh_odometry_lets_the_next_wait_for_its_turn(bench):
    bench.base.waiting = [lambda: None]
    assert bench.stick(0.5) is None
    assert bench.base.waiting


def test_operator_silent_longer_than_the_bridge_is_named(bench):
    stall(bench, 0.15)
    bench.pass_time(0.4)
    assert needed(bench).code == "dead_man"


def test_late_console_is_named_as_the_cause_afterwards(bench):
    bench.pass_time(0.35)
    assert needed(bench).code == "dead_man"
    bench.core.console_was_late(0.3, bench.now_s)
    assert needed(bench).code == "overloaded"
    assert needed(bench).text == "this computer is overloaded: the server was 0.3 s late"
    assert bench.core.state(bench.now_s, []).overload == Overload("console", 0.3)


def test_an_older_silence_stays_the_operators(bench):
    bench.pass_time(2.0)
    bench.core.console_was_late(0.3, bench.now_s)
    assert needed(bench).code == "dead_man"


def test_overload_is_reported_some_seconds_and_logged(bench, caplog):
    for _ in range(3):
        stall(bench, 0.2)
    stall(bench, 0.3)
    assert bench.core.state(bench.now_s, []).overload == Overload("bridge", 0.3)
    bench.pass_time(KEPT_S + 0.2)
    assert bench.core.state(bench.now_s, []).overload is None
    said = [record.getMessage() for record in caplog.records if "this computer" in record.getMessage()]
    assert said == [
        "this computer is overloaded: the bridge was 0.20 s late",
        "this computer keeps up again; the bridge was up to 0.30 s late",
    ]


def test_a_tick_in_time_says_nothing(bench):
    bench.core.tick(bench.now_s, 0.02)
    assert bench.core.state(bench.now_s, []).overload is None


def test_short_delay_is_not_reported_but_clears_the_operator():
    lateness = LoopLateness("bridge")
    lateness.observe(0.15, now_s=1.0)
    assert lateness.report(1.0) is None
    assert lateness.since(0.9) == 0.15
    lateness.observe(0.2, now_s=2.0)
    assert lateness.report(2.0) == Overload("bridge", 0.2)
