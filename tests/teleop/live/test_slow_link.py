"""The link slows down while the stick is held still: each command arrives later, and the console notices."""

import asyncio
from types import SimpleNamespace

import pytest

from robots.bridge.drive.drive_input import COMMAND_LIFE_S
from robots.shared import wire
from robots.shared.geometry.poses import STILL
from teleop.live import view_feed
from teleop.live.view_feed import Viewer
from tests.bridge.support import Bench

PAGE_S = 1 / 30  # between two commands of a page
TICK_S = 0.05


class HeldStick:
    """A page whose commands take `slower` seconds longer each second; the sensor data are in time."""

    def __init__(self, bench, slower):
        self.bench, self.slower = bench, slower
        self.begin_s = bench.now_s
        self.sent = 0
        self.newest_s = bench.now_s  # time at which the newest obeyed command was sent
        self.refused = []

    def passes(self, seconds):
        """Yield at each command and each tick, ordered by time."""
        bench, begin_s = self.bench, self.bench.now_s
        ticks_s = [begin_s + n * TICK_S for n in range(1, round(seconds / TICK_S))]
        while ticks_s:
            sent_s = self.begin_s + self.sent * PAGE_S
            comes_s = sent_s + self.slower * (sent_s - self.begin_s)
            if comes_s > ticks_s[0]:
                bench.now_s = ticks_s.pop(0)
                bench.odometry()
                bench.core.tick(bench.now_s)
            else:
                bench.now_s, self.sent = comes_s, self.sent + 1
                self._comes(sent_s)
            yield

    def _comes(self, sent_s):
        bench = self.bench
        refusal = bench.stick(0.5, age_s=bench.now_s - sent_s)
        if refusal is None:
            self.newest_s = sent_s
        else:
            self.refused.append(refusal.code)


@pytest.fixture
def driven():
    return Bench().online().granted().driving()


@pytest.mark.parametrize("slower", [0.03, 0.1, 0.5])
def test_command_moves_the_robot_no_longer_than_it_lives(driven, slower):
    stick = HeldStick(driven, slower)
    for _ in stick.passes(1.0 + 1.2 * COMMAND_LIFE_S / slower):
        if driven.last != STILL:
            assert driven.now_s - stick.newest_s <= COMMAND_LIFE_S + TICK_S
    assert {"too_old", "neutral_needed"} & set(stick.refused)
    assert driven.last == STILL
    assert driven.core.state(driven.now_s, []).neutral_needed is not None


def test_late_answers_of_a_page_reach_the_gate_with_the_grant(driven, monkeypatch):
    """The page acknowledges views on the connection of its commands, so a delay affects both.

    This also detects a delay that grows too slowly for the check of a command's age: the age is measured from
    the best delay of the last minute.
    """
    now = SimpleNamespace(s=0.0)
    monkeypatch.setattr(view_feed, "time", SimpleNamespace(monotonic=lambda: now.s))
    feed = SimpleNamespace(add=lambda _: 1, number=0, turn_length=1, ready=set())
    viewer = Viewer(feed, send=None)

    def answers(*delays_s):
        for delay_s in delays_s:
            viewer.sent_s, now.s = now.s, now.s + delay_s
            asyncio.run(viewer.acknowledge())
        grant = wire.Grant(1, 60.0, "session-1", "Ann", "ann-id", 1.0, delay_s=viewer.delay_s)
        driven.core.grant(grant, 1, driven.now_s)
        return driven.gate.operator_delay_s

    assert answers(*[0.05] * 40) == pytest.approx(0.05)
    assert answers(0.6, 0.6) == pytest.approx(0.05)  # two samples may be chance
    assert answers(0.6) == pytest.approx(0.6)


def test_link_delay_is_measured_while_the_stick_is_still(driven):
    """Only commands are late. No sensor shows this, but the acknowledgements of the twists do."""

    def latency_after(echo_s):
        driven.base.echo_s = echo_s
        for _ in range(20):
            driven.stick(0.5)
            driven.pass_time(0.05)
        return driven.core.state(driven.now_s, []).latency_s

    usual_s = latency_after(0.02)
    assert latency_after(0.42) == pytest.approx(usual_s + 0.38, abs=0.01)
    assert latency_after(0.02) == usual_s
