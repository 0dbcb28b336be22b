"""Input filters: the effect of each, and limits that every chain keeps."""

from __future__ import annotations

import math
from itertools import pairwise

import msgspec
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from robots.bridge.drive.drive_input import DriveInput
from robots.shared.configuration.input_filters import (
    COMMAND_LIFE_S,
    DEFAULT,
    SMOOTHING,
    Curve,
    DeadZone,
    Mean,
    OneEuro,
    Scale,
    Snap,
    StickPosition,
    StickStep,
    apply_filters,
)
from robots.shared.wire import Drive
from tests.bridge.support import CONFIG, Bench

PERIOD_S = 0.05
CENTRE = StickPosition(0.0, 0.0, 0.0)

axes = st.floats(-1.0, 1.0)
positions = st.builds(StickPosition, axes, axes, axes)
gaps_s = st.floats(0.0, 1.0)
steps: dict[type, st.SearchStrategy[StickStep]] = {
    Scale: st.builds(Scale, *[st.floats(0.0, 1.0)] * 3),
    DeadZone: st.builds(DeadZone, st.floats(0.0, 0.5)),
    Curve: st.builds(Curve, st.floats(1.0, 4.0)),
    Snap: st.builds(Snap, st.floats(0.1, 45.0), st.floats(0.01, 1.0)),
    OneEuro: st.builds(OneEuro, st.floats(0.01, 20.0), st.floats(0.0, 50.0), st.floats(0.01, 20.0)),
    Mean: st.builds(Mean, st.integers(2, 20), st.floats(0.01, 2.0)),
}
steadying = st.one_of(steps[OneEuro], steps[Mean])
chains = (
    st.lists(st.sampled_from(list(steps)), unique=True)
    .filter(lambda kinds: len({*kinds} & {*SMOOTHING}) < 2)
    .flatmap(lambda kinds: st.tuples(*(steps[kind] for kind in kinds)))
)
hands = st.lists(st.tuples(positions, gaps_s), min_size=1, max_size=30)


def through(chain: tuple[StickStep, ...], hand: list[tuple[StickPosition, float]]) -> list[StickPosition]:
    """Filter stick positions, each with the time (s) since the previous position."""
    memory, given = None, []
    for position, gap_s in hand:
        position, memory = apply_filters(chain, memory, position, gap_s)
        given.append(position)
    return given


def steadily(chain: tuple[StickStep, ...], values: list[float]) -> list[float]:
    """Filter only the forward axis, 20 times a second."""
    return [p.x for p in through(chain, [(StickPosition(value, 0.0, 0.0), PERIOD_S) for value in values])]


# --- limits of every chain ------------------------------------------------------------------------


@given(chains, hands)
def test_released_stick_is_zero_at_once(chain, hand):
    assert through(chain, [*hand, (CENTRE, PERIOD_S)])[-1] == CENTRE


@given(steadying, hands, positions)
def test_a_reversed_axis_goes_the_other_way_at_once(step, hand, last):
    *_, before, after = through((step,), [*hand, (last, PERIOD_S)])
    for axis, was, now in zip(last, before, after, strict=True):
        if axis * was < 0.0:
            assert now == axis


@given(chains, hands)
def test_no_filter_leaves_the_range_of_the_stick(chain, hand):
    for position in through(chain, hand):
        assert all(math.isfinite(axis) and abs(axis) <= 1.0 for axis in position)


@given(chains, hands)
def test_axis_never_exceeds_the_hands_value_since_release(chain, hand):
    largest = [0.0, 0.0, 0.0]
    for (held, gap_s), given_now in zip(hand, through(chain, hand), strict=True):
        for index, axis in enumerate(held):
            largest[index] = max(abs(axis), 0.0 if axis == 0.0 or gap_s > COMMAND_LIFE_S else largest[index])
            assert abs(given_now[index]) <= largest[index] + 1e-12


@given(chains, hands)
def test_an_axis_never_goes_against_the_hand(chain, hand):
    for (held, _), given_now in zip(hand, through(chain, hand), strict=True):
        assert not any(
            mine < 0.0 < theirs or theirs < 0.0 < mine for mine, theirs in zip(given_now, held, strict=True)
        )


@given(chains, hands, hands)
def test_gap_of_a_commands_life_clears_the_memory(chain, before, hand):
    begun = [(hand[0][0], 2 * COMMAND_LIFE_S), *hand[1:]]
    assert through(chain, before + begun)[len(before) :] == through(chain, begun)


@given(steadying, st.floats(0.01, 1.0), st.floats(0.01, 0.3))
def test_a_hand_that_rests_is_given_as_it_is_in_the_end(step, value, gap_s):
    assume(not isinstance(step, OneEuro) or step.min_hz >= 0.5)
    assert through((step,), [(StickPosition(value, 0.0, 0.0), gap_s)] * 400)[-1].x == pytest.approx(
        value, abs=1e-3
    )


# --- effect of each filter ------------------------------------------------------------------------


def test_scale_makes_less_of_each_axis():
    assert Scale(0.5, 0.0, 1.0)(StickPosition(1.0, 1.0, -1.0)) == StickPosition(0.5, 0.0, -1.0)


def test_a_dead_zone_swallows_the_middle_and_leaves_the_rim():
    zone = DeadZone(0.1)
    assert zone(StickPosition(0.1, -0.05, 0.0)) == CENTRE
    assert zone(StickPosition(1.0, -1.0, 0.55)) == pytest.approx((1.0, -1.0, 0.5))


def test_a_dead_zone_begins_without_a_jump():
    assert DeadZone(0.1)(StickPosition(0.101, 0.0, 0.0)).x == pytest.approx(0.0, abs=2e-3)


def test_a_curve_is_finer_in_the_middle_and_full_at_the_rim():
    assert Curve(2.0)(StickPosition(0.5, -0.5, 1.0)) == pytest.approx((0.25, -0.25, 1.0))
    assert Curve()(StickPosition(0.3, 0.0, -0.7)) == StickPosition(0.3, 0.0, -0.7)


@pytest.mark.parametrize(
    ("held", "given"),
    [
        (StickPosition(0.1, 0.0, 0.9), StickPosition(0.0, 0.0, 0.225)),
        (StickPosition(-0.1, 0.0, -0.8), StickPosition(0.0, 0.0, -0.2)),
        (StickPosition(0.5, 0.0, 0.5), StickPosition(0.5, 0.0, 0.5)),
        (StickPosition(0.9, 0.0, 0.0), StickPosition(0.9, 0.0, 0.0)),
        (StickPosition(0.0, 0.4, 0.9), StickPosition(0.0, 0.4, 0.9)),
    ],
)
def test_a_stick_held_sideways_turns_on_the_spot_at_a_quarter(held, given):
    assert Snap()(held) == pytest.approx(given)


def test_the_mean_goes_back_as_far_as_inputs_are_similar():
    assert steadily((Mean(5, 0.2),), [0.5, 0.6, 0.4, 0.5])[-1] == pytest.approx(0.5)
    assert steadily((Mean(5, 0.2),), [0.5, 0.5, 0.5, 0.9])[-1] == 0.9
    assert steadily((Mean(2, 2.0),), [0.2, 0.4, 0.6])[-1] == pytest.approx(0.5)


def test_one_euro_steadies_a_hand_at_rest():
    shaking = [0.6 + 0.02 * (-1) ** number for number in range(100)]
    shakes = [abs(after - before) for before, after in pairwise(steadily((OneEuro(),), shaking)[40:])]
    assert max(shakes) < 0.04 / 3


def test_one_euro_hardly_holds_back_a_hand_on_the_move():
    """The stick moves from the middle to the rim in half a second: the filter delays it by at most 30 ms."""
    speed = 2.0
    held = [speed * PERIOD_S * number for number in range(1, 11)]
    for was, now in zip(held, steadily((OneEuro(),), held), strict=True):
        assert was - 0.03 * speed <= now <= was


# --- in the bridge --------------------------------------------------------------------------------


def drive(seq: int, x: float) -> Drive:
    return Drive(fence=1, seq=seq, sent_ms=1000.0 + seq * 50.0, x=x, w=0.0, share=1.0)


def test_command_is_filtered_once_however_often_it_is_read():
    stick = DriveInput((OneEuro(),))
    stick.accept(drive(1, 0.2), 1.0)
    stick.accept(drive(2, 0.6), 1.05)
    first = stick.current(1.06)
    assert 0.2 < first.x < 0.6
    assert [stick.current(1.06 + tick * 0.05) for tick in range(3)] == [first] * 3


def test_a_command_that_is_refused_leaves_no_trace():
    used, unused = DriveInput((OneEuro(),)), DriveInput((OneEuro(),))
    for stick in (used, unused):
        stick.accept(drive(5, 0.2), 1.0)
    assert used.accept(drive(4, 1.0), 1.02) is not None
    for stick in (used, unused):
        stick.accept(drive(6, 0.3), 1.05)
    assert used.current(1.06) == unused.current(1.06)


@pytest.fixture
def bench():
    bench = Bench(config=msgspec.structs.replace(CONFIG, stick=DEFAULT)).online().granted()
    yield bench
    bench.close()


def test_robot_gets_the_filtered_command(bench):
    bench.driving(0.5)
    bench.pass_time(0.05)
    bench.stick(0.6)
    assert 0.4 < bench.last.vx < 0.6


def test_a_stick_in_the_dead_zone_counts_as_neutral(bench):
    bench.driving(0.5)
    bench.core.stop("Ann", "", bench.now_s)
    bench.core.clear(bench.core.stop_state.number, bench.now_s)
    assert bench.stick(0.5).code == "neutral_needed"
    assert bench.stick(0.02) is None
    assert bench.stick(0.5) is None


def test_stop_clears_the_filters_memory(bench):
    bench.driving(1.0)
    bench.core.stop("Ann", "", bench.now_s)
    bench.core.clear(bench.core.stop_state.number, bench.now_s)
    bench.pass_time(0.05)
    bench.stick(0.0)
    bench.pass_time(0.05)
    bench.stick(0.2)
    assert 0.0 < bench.last.vx < 0.2


def test_a_new_holder_inherits_no_hand(bench):
    bench.driving(1.0)
    fresh = Bench(config=bench.core.config).online().granted(2)
    bench.granted(2)
    for each in (bench, fresh):
        each.pass_time(0.05)
        each.stick(0.3, fence=2)
        each.recorded()
        each.pass_time(0.05)
    assert bench.core.state(bench.now_s, []).verdict.asked == fresh.core.state(fresh.now_s, []).verdict.asked
    fresh.close()
