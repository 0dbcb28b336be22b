"""The words that people read are steady; the robot gets each decision at once."""

from __future__ import annotations

import itertools

import pytest

from robots.bridge.steady_view import DRIVES_S, LIMITS_S, STANDS_S, SteadyLimits, SteadyVerdict
from robots.shared.configuration.gate_profile import Parameters
from robots.shared.geometry.poses import STILL, Velocity
from robots.shared.records.verdict import SpeedLimit, Verdict
from tests.bridge.support import Bench
from tests.gate.conftest import tiago_profile
from tests.gate.world import World, leg, wall

FORWARD = Velocity(0.5, 0.0, 0.2)


def verdict(allowed, code="obstacle", gap_m=0.1, side="ahead", asked=FORWARD, sensor="laser"):
    text = "" if code == "free" else f"{allowed.vx:.2f} m/s: {sensor}, {gap_m} m {side}"
    return Verdict(allowed, asked, code, text, sensor, gap_m, 0.0, side, (0.4, 0.0))


SLOWED, TURNS, STOPPED = Velocity(0.02, 0.0, 0.2), Velocity(0.0, 0.0, 0.2), STILL


def changes(verdicts, seconds=6.0):
    """How often the shown words change within some seconds of these verdicts in turn, and all shown words."""
    steady, told = SteadyVerdict(), []
    for tick, newest in zip(range(round(seconds / 0.05)), itertools.cycle(verdicts), strict=False):
        steady.observe(newest, 100.0 + 0.05 * tick)
        told.append((steady.shown.code, steady.shown.text))
        assert steady.shown.velocity == newest.velocity, "the twists are the newest ones"
    return sum(one != other for one, other in itertools.pairwise(told)), told


@pytest.mark.parametrize(
    "flicker",
    [
        [verdict(SLOWED), verdict(TURNS)],
        [verdict(SLOWED)] * 5 + [verdict(TURNS)],
        [verdict(STOPPED)] + [verdict(SLOWED)] * 20,
        [verdict(TURNS), verdict(TURNS, side="ahead left"), verdict(TURNS, sensor="laser, remembered")],
        [verdict(TURNS, gap_m=0.09), verdict(TURNS, gap_m=0.1)],
        [verdict(SLOWED, "near_miss"), verdict(SLOWED, "free")],
        [verdict(STOPPED, "mover"), verdict(SLOWED, "obstacle")],
        [verdict(Velocity(0.3, 0.0, 0.0), "scan_late")] + [verdict(FORWARD, "free")] * 4,
        [verdict(Velocity(0.1, 0.0, 0.0), "blind_direction"), verdict(TURNS)],
    ],
)
def test_words_that_flicker_are_shown_once(flicker):
    changed, told = changes(flicker)
    assert changed <= 1, set(told)


def test_stricter_words_are_shown_at_once():
    steady = SteadyVerdict()
    for tick, allowed in enumerate((FORWARD, SLOWED, TURNS, STOPPED)):
        newest = verdict(allowed)
        steady.observe(newest, 100.0 + 0.05 * tick)
        assert steady.shown == newest


@pytest.mark.parametrize(
    ("allowed", "hold_s"), [(SLOWED, STANDS_S), (Velocity(0.3, 0.0, 0.0), DRIVES_S), (FORWARD, DRIVES_S)]
)
def test_milder_words_are_shown_after_a_while(allowed, hold_s):
    steady = SteadyVerdict()
    steady.observe(verdict(STOPPED), 100.0)
    milder = verdict(allowed, "free" if allowed == FORWARD else "obstacle")
    waited_s = next(
        0.05 * tick
        for tick in range(1, 100)
        if steady.observe(milder, 100.0 + 0.05 * tick) or steady.shown.text == milder.text
    )
    assert waited_s == pytest.approx(hold_s, abs=0.06)


@pytest.mark.parametrize(
    "newest",
    [
        verdict(FORWARD, "idle", asked=STILL),
        verdict(Velocity(-0.1, 0.0, 0.0), "free", asked=Velocity(-0.1, 0.0, 0.0)),
        verdict(STILL, "neutral_needed"),
        verdict(STILL, "stopped"),
        verdict(STILL, "odometry_stale")._replace(neutral=True),
    ],
)
def test_another_request_or_another_rule_is_shown_at_once(newest):
    steady = SteadyVerdict()
    steady.observe(verdict(STOPPED), 100.0)
    steady.observe(newest, 100.05)
    assert steady.shown == newest


def test_the_drawn_place_is_no_older_than_the_decision():
    steady = SteadyVerdict()
    steady.observe(verdict(STOPPED), 100.0)
    steady.observe(verdict(SLOWED, "near_miss", sensor="sonar"), 100.05)
    assert steady.shown.text == verdict(STOPPED).text and steady.shown.point is None


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("scene", ["leg ahead", "wall behind"])
def test_a_robot_held_by_an_obstacle_says_one_thing(scene, seed):
    """With noise of laser and sonars, as measured: without the steady view, one to three changes a second."""
    asked = Velocity(0.5, 0.0, 0.0) if scene == "leg ahead" else Velocity(-0.5, 0.0, 0.2)
    segments = leg(0.9, 0.15) if scene == "leg ahead" else wall(-1.0, -2, -1.0, 2)
    profile = tiago_profile(parameters=Parameters())
    world = World(profile, segments, seed, sonar_noise_m=0.02, lost_echoes=0.1)
    world.drive(asked, 8.0)
    steady, told = SteadyVerdict(), []
    for _ in range(120):
        steady.observe(world.drive(asked, 0.05), world.now_s)
        told.append(steady.shown.text.split(" (")[0].split(" from")[0])
    assert sum(one != other for one, other in itertools.pairwise(told)) <= 2, set(told)


def test_a_limit_that_comes_and_goes_is_shown_all_the_time():
    steady, limit = SteadyLimits(), SpeedLimit("depth_stale", "0.5 s old", 0.3)
    older = limit._replace(text="0.6 s old")
    shown = [
        steady.of([limit, older][tick % 2 :][:1] if tick % 3 else [], 0.1 * tick) for tick in range(1, 40)
    ]
    assert all(len(limits) == 1 for limits in shown)
    texts = [limits[0].text for limits in shown]
    assert sum(one != other for one, other in itertools.pairwise(texts)) <= 4.0 / LIMITS_S
    assert steady.of([], 4.0 + LIMITS_S) == []
    assert [one.mps for one in steady.of([limit], 6.0) + steady.of([limit._replace(mps=0.1)], 6.1)] == [
        0.3,
        0.1,
    ]


def test_pages_read_one_thing_while_the_gate_flickers():
    bench = Bench().online()
    try:
        bench.granted().driving()
        answers = itertools.cycle([verdict(SLOWED), verdict(TURNS), verdict(STOPPED, gap_m=0.09)])
        bench.gate.says = lambda asked: next(answers)._replace(asked=asked)
        read, sent = set(), set()
        for tick in range(60):
            bench.stick(0.5)
            bench.pass_time(0.05)
            sent.add(bench.last)
            if tick > 5:
                read.add(bench.core.state(bench.now_s, []).verdict.text)
        assert read == {verdict(STOPPED, gap_m=0.09).text}
        assert sent >= {SLOWED, TURNS, STOPPED}, "the robot gets each decision"
        bench.recorded()
        assert bench.sink.kinds.count("gate.begin") == 1, "and the log has one intervention"
    finally:
        bench.close()
