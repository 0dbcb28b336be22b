"""A path is short and gives the robot's position at any time."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.bridge.audit.drive_path import LEVER_M, TOLERANCE_M, Path, simplify
from robots.shared.records.record_sink import Sample

CENTIMETRE = 0.01


def straight(*speeds_mps: float) -> list[Sample]:
    """Two samples a second along a line, with a new speed each second."""
    samples, x, t_s = [Sample(0.0, 0.0, 0.0, 0.0, 0.0)], 0.0, 0.0
    for speed, _half in itertools.product(speeds_mps, range(2)):
        t_s, x = t_s + 0.5, x + speed / 2
        samples.append(Sample(t_s, x, 0.0, 0.0, speed))
    return samples


def wandering(count: int) -> list[Sample]:
    """A robot that drives growing figures of eight, never straight."""
    return [
        Sample(i / 2, (1 + i / 500) * math.sin(i / 9), (1 + i / 500) * math.sin(i / 4.5), i / 9, 0.3)
        for i in range(count)
    ]


def miss_m(path: Sequence[Sample], truth: Iterable[Sample]) -> float:
    """The largest error of linear motion between the samples."""
    worst, legs = 0.0, list(itertools.pairwise(path))
    for sample in truth:
        before, after = next(leg for leg in legs if leg[0].t_s <= sample.t_s <= leg[1].t_s)
        share = (sample.t_s - before.t_s) / (after.t_s - before.t_s)
        x, y, yaw = (a + share * (b - a) for a, b in zip(before[1:4], after[1:4], strict=True))
        worst = max(worst, math.hypot(x - sample.x, y - sample.y, LEVER_M * (yaw - sample.yaw)))
    return worst


def test_an_even_drive_straight_on_is_its_two_ends() -> None:
    samples = straight(0.5, 0.5, 0.5, 0.5)
    assert simplify(samples, CENTIMETRE) == [samples[0], samples[-1]]


def test_a_corner_is_kept() -> None:
    there = straight(0.5, 0.5)
    back = [Sample(s.t_s + 2.0, 1.0, s.x, 0.0, s.speed) for s in straight(0.5, 0.5)[1:]]
    assert simplify(there + back, CENTIMETRE) == [there[0], there[-1], back[-1]]


def test_pause_on_a_straight_way_is_kept() -> None:
    samples = straight(0.5, 0.0, 0.0, 0.0, 0.5)
    assert [sample.t_s for sample in simplify(samples, CENTIMETRE)] == [0.0, 1.0, 4.0, 5.0]


def test_a_turn_on_the_spot_is_kept() -> None:
    yaws = [0.0, 0.0, 0.5, 1.0, 1.0]
    samples = [Sample(t / 2, 0.0, 0.0, yaw, 0.0) for t, yaw in enumerate(yaws)]
    assert [sample.yaw for sample in simplify(samples, CENTIMETRE)] == [0.0, 0.0, 1.0, 1.0]


@pytest.mark.parametrize("count", [0, 1, 2])
def test_minimal_path_is_unchanged(count: int) -> None:
    samples = straight(0.5)[:count]
    assert simplify(samples, CENTIMETRE) == samples


@given(
    st.lists(st.tuples(*[st.floats(-50.0, 50.0)] * 3), min_size=2, max_size=60),
    st.sampled_from([0.01, 0.05, 1.0]),
)
def test_no_sample_is_farther_from_the_path_than_the_tolerance(
    poses: list[tuple[float, float, float]], tolerance_m: float
) -> None:
    samples = [Sample(t / 2, *pose, 0.0) for t, pose in enumerate(poses)]
    path = simplify(samples, tolerance_m)
    assert (path[0], path[-1]) == (samples[0], samples[-1])
    assert miss_m(path, samples) <= tolerance_m + 1e-9


def grown(path: Path, samples: Sequence[Sample], at_once: int) -> Path:
    for first in range(0, len(samples), at_once):
        path.extend(samples[first : first + at_once])
    return path


def test_a_path_that_grows_bit_by_bit_keeps_its_tolerance() -> None:
    samples = wandering(400)
    path = grown(Path(), samples, at_once=50)
    assert path.tolerance_m == TOLERANCE_M
    assert miss_m(path.samples, samples) <= TOLERANCE_M


def test_path_of_hours_has_limited_size_and_known_tolerance() -> None:
    samples = wandering(3 * 3600 * 2)
    path = grown(Path(), samples, at_once=120)
    assert len(path.samples) <= 600
    assert (path.samples[0], path.samples[-1]) == (samples[0], samples[-1])
    assert path.tolerance_m > TOLERANCE_M
    assert miss_m(path.samples, samples[::7]) <= path.tolerance_m


def test_a_path_of_nothing_is_nothing() -> None:
    path = Path()
    path.extend([])
    assert path.samples == []
