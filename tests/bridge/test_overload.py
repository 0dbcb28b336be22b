"""A computer that is late blames itself and not the operator: in words, with figures, and once in the log."""

from __future__ import annotations

import pytest

from robots.bridge.gate.values import STILL
from robots.bridge.overload import KEPT_S, LoopLateness
from robots.wire import Overload
from tests.bridge.support import Bench


@pytest.fixture
def bench():
    bench = Bench().online()
    yield bench.granted().driving()
    bench.close()


def needed(bench):
    return bench.core.state(bench.now_s, []).neutral_needed


def stall(bench, late_s):
    """The bridge's loop gets no processor for so long."""
    bench.now_s += late_s
    bench.odometry()
    bench.core.tick(bench.now_s, late_s)


def test_commands_that_lay_unread_while_the_bridge_was_late_are_not_held_against_the_operator(bench):
    stall(bench, 0.4)
    assert bench.last == STILL
    assert needed(bench).code == "overloaded"
    assert needed(bench).text == "this computer is overloaded: the bridge was 0.4 s late"
    assert bench.core.state(bench.now_s, []).overload == Overload("bridge", 0.4)


def test_an_operator_who_is_silent_longer_than_the_bridge_was_late_is_told_so(bench):
    stall(bench, 0.15)
    bench.pass_time(0.4)
    assert needed(bench).code == "dead_man"


def test_a_console_that_was_late_says_so_afterwards_and_takes_the_blame(bench):
    bench.pass_time(0.35)
    assert needed(bench).code == "dead_man"
    bench.core.console_was_late(0.3, bench.now_s)
    assert needed(bench).code == "overloaded"
    assert needed(bench).text == "this computer is overloaded: the console was 0.3 s late"
    assert bench.core.state(bench.now_s, []).overload == Overload("console", 0.3)


def test_an_older_silence_stays_the_operators(bench):
    bench.pass_time(2.0)
    bench.core.console_was_late(0.3, bench.now_s)
    assert needed(bench).code == "dead_man"


def test_an_overload_is_told_for_some_seconds_and_logged_when_it_begins_and_ends(bench, caplog):
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


def test_a_short_delay_alarms_nobody_and_still_clears_the_operator():
    lateness = LoopLateness("bridge")
    lateness.observe(0.15, now_s=1.0)
    assert lateness.told(1.0) is None
    assert lateness.since(0.9) == 0.15
    lateness.observe(0.2, now_s=2.0)
    assert lateness.told(2.0) == Overload("bridge", 0.2)
