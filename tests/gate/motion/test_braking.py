"""The allowed share of a twist is monotone, and braking that starts in time ends in time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.bridge.gate.motion import braking
from robots.shared.geometry.poses import Velocity
from tests.gate.conftest import tiago_profile

seconds = st.floats(0.0, 10.0)
some_seconds = st.floats(0.01, 3.0)


@given(seconds, seconds, some_seconds, some_seconds)
def test_more_time_to_contact_never_means_less_speed(one, other, latency, braking_time):
    less, more = sorted((one, other))
    scale = braking.scale
    assert scale(less, latency, braking_time) <= scale(more, latency, braking_time)


@given(seconds, some_seconds, some_seconds, some_seconds)
def test_more_latency_never_means_more_speed(until, one, other, braking_time):
    less, more = sorted((one, other))
    assert braking.scale(until, more, braking_time) <= braking.scale(until, less, braking_time) + 1e-12


@given(seconds, some_seconds, some_seconds)
def test_a_scaled_twist_has_braked_before_contact(until, latency, braking_time):
    s = braking.scale(until, latency, braking_time)
    assert 0.0 <= s <= 1.0
    assert s * latency + s**2 * braking_time / 2.0 <= until + 1e-9


@given(some_seconds, some_seconds)
def test_nothing_is_taken_away_that_need_not_be(latency, braking_time):
    assert braking.scale(latency + braking_time / 2.0, latency, braking_time) == 1.0
    assert braking.scale(math.inf, latency, braking_time) == 1.0


def test_contact_now_or_behind_the_reserve_is_zero():
    assert braking.scale(0.0, 0.2, 1.0) == 0.0
    assert braking.scale(-3.0, 0.2, 1.0) == 0.0


def test_braking_time_is_that_of_the_slower_axis():
    profile = tiago_profile()
    assert braking.braking_time(Velocity(0.65, 0.0, 0.0), profile) == pytest.approx(1.0)
    assert braking.braking_time(Velocity(0.0, 0.0, 1.3 * 2.0944), profile) == pytest.approx(2.0)
    assert braking.braking_time(Velocity(0.65, 0.0, 1.3 * 2.0944), profile) == pytest.approx(2.0)


@given(st.floats(0.0, 5.0), st.floats(0.05, 1.0))
def test_speed_before_a_narrow_place_can_brake_in_time(distance, there):
    now = braking.speed_before(np.array([distance]), np.array([there]), 0.2, 0.8)[0]
    assert now >= there
    assert now == there or now * 0.2 + (now**2 - there**2) / 1.6 <= distance + 1e-9
