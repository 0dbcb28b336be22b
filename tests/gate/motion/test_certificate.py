"""A certificate never passes a twist that the full computation would reduce: both are compared."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest

from robots.bridge.gate.motion.certificate import plays_clear, restrains_nothing
from robots.bridge.gate.motion.corridors import Box, Corridors
from robots.bridge.gate.motion.rollout import Sent, safe_share
from robots.bridge.gate.motion.safe_twist import restrain
from robots.shared.configuration.gate_profile import Limits, Parameters
from robots.shared.geometry.footprint import footprint_of
from robots.shared.geometry.poses import Velocity
from tests.gate.conftest import tiago_profile

PERIOD_S = 0.05
EMPTY = Corridors(np.empty((0, 2)))
HULLS = (
    {"radius_m": 0.27, "outline": None},
    {"radius_m": None, "outline": ((0.4, -0.25), (0.4, 0.25), (-0.4, 0.25), (-0.4, -0.25))},
    {"radius_m": None, "outline": ((0.5, 0.0), (-0.2, 0.3), (-0.2, -0.3))},
    {"radius_m": None, "outline": None, "discs": ((0.25, 0.05, 0.2), (-0.2, 0.0, 0.25))},
)


def any_profile(random):
    return tiago_profile(
        **HULLS[random.integers(len(HULLS))],
        limits=Limits(
            random.uniform(0.3, 2.0), 0.5, 0.5, random.uniform(0.5, 3.0), *random.uniform(0.3, 2.5, 2)
        ),
        parameters=Parameters(
            lateral_margin_m=random.uniform(0.0, 0.1),
            front_margin_m=random.uniform(0.0, 0.2),
            latency_s=random.uniform(0.05, 0.6),
            creep_mps=random.uniform(0.05, 0.3),
            near_miss_s=random.uniform(0.0, 0.2),
        ),
    )


def any_twist(random, limits, sideways=0.0):
    bend = random.choice([0.0, 1e-4, 0.1, 0.4, 1.0])
    return Velocity(
        random.uniform(-limits.reverse_mps, limits.forward_mps),
        random.uniform(-sideways, sideways),
        bend * random.uniform(-limits.turn_radps, limits.turn_radps),
    )


def on_the_border(certified, random):
    """Points in all directions, as near as the certificate allows."""
    rays = np.concatenate((random.uniform(-math.pi, math.pi, 60), np.linspace(-math.pi, math.pi, 60)))
    points = []
    for x, y in zip(np.cos(rays), np.sin(rays), strict=True):
        low, high = 0.0, 30.0
        while high - low > 1e-4:
            middle = (low + high) / 2.0
            inside = not certified(np.array([(middle * x, middle * y)]))
            low, high = (middle, high) if inside else (low, middle)
        points.append((high * x, high * y))
    return np.array(points).T.copy().T if certified(np.array(points)) else None


@pytest.mark.parametrize("seed", range(60))
def test_arcs_reduce_no_certified_twist(seed):
    random = np.random.default_rng(seed)
    profile = any_profile(random)
    hull = footprint_of(profile)
    wanted = any_twist(random, profile.limits)
    turn_rates = tuple(random.uniform(-1.0, 1.0, 2) * random.choice([0.0, 0.2, 1.0]))
    points = on_the_border(
        lambda points: restrains_nothing(wanted, turn_rates, Corridors(points), hull, profile), random
    )
    if points is None:
        assert not restrains_nothing(wanted, turn_rates, EMPTY, hull, profile), "too tight an arc"
    else:
        source = np.zeros(len(points), dtype=np.intp)
        found = restrain(wanted, turn_rates, points, source, hull, profile)
        assert (found.velocity, found.cause) == (wanted, None)


@pytest.mark.parametrize("seed", range(60))
def test_a_roll_out_reduces_no_certified_twist(seed):
    random = np.random.default_rng(seed)
    profile = any_profile(random)
    hull = footprint_of(profile)
    candidate, measured, *sent = (
        any_twist(random, profile.limits, 0.1) for _ in range(random.integers(2, 8))
    )
    ages = sorted(random.uniform(0.0, 0.5, len(sent)), reverse=True)
    queue = [Sent(velocity, age_s) for velocity, age_s in zip(sent, ages, strict=True)]
    points = on_the_border(
        lambda points: plays_clear(candidate, queue, measured, Corridors(points), hull, profile, PERIOD_S),
        random,
    )
    if points is None:
        assert not plays_clear(candidate, queue, measured, EMPTY, hull, profile, PERIOD_S), "too far round"
    else:
        latency_s = profile.parameters.latency_s
        rolled = safe_share(candidate, queue, measured, points, None, hull, profile, PERIOD_S, latency_s)
        assert rolled.share == 1.0


@pytest.mark.parametrize("seed", range(20))
def test_a_corridor_is_clear_only_if_no_point_is_in_the_box(seed):
    random = np.random.default_rng(seed)
    points = np.append(random.uniform(-3.0, 3.0, (30, 2)), [(math.nan, math.nan), (math.inf, 0.0)], axis=0)
    corridors, (x, y) = Corridors(points), points.T
    found = Counter()
    for _ in range(200):
        box, reverse = (
            Box(*random.uniform(0.0, 2.2, 3) * random.choice([0.1, 0.3, 1.0])),
            random.random() < 0.5,
        )
        box = box._replace(rounded=random.choice([0.0, 0.5, 1.0]) * min(box[:3]))
        along = -x if reverse else x
        beyond_x = np.maximum(along - box.ahead, -box.behind - along) + box.rounded
        beyond_y = np.abs(y) - box.aside + box.rounded
        in_corner = np.hypot(np.maximum(beyond_x, 0.0), np.maximum(beyond_y, 0.0)) <= box.rounded
        free = not ((beyond_x <= box.rounded) & (beyond_y <= box.rounded) & in_corner).any()
        clear = corridors.are_clear(box, reverse=reverse)
        assert clear == free
        found[free] += 1
    assert len(found) == 2, found


def test_a_command_from_the_future_is_played():
    profile = tiago_profile()
    hull, ahead = footprint_of(profile), Velocity(0.2, 0.0, 0.0)
    assert plays_clear(ahead, [Sent(ahead, 0.0)], ahead, EMPTY, hull, profile, PERIOD_S)
    assert not plays_clear(ahead, [Sent(ahead, -0.1)], ahead, EMPTY, hull, profile, PERIOD_S)
