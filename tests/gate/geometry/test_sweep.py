"""The swept space covers the arm at every moment of its motion, and little more."""

import math
from itertools import pairwise

import numpy as np
import pytest

from robots.bridge.gate.arm.sweep import CELL_M, Motion, intruder, swept, thinned
from robots.bridge.gate.values import Obstacles

RADIUS_M = 0.1


def two_links(positions):
    """Joints and tip of a planar arm with two links of 0.4 m."""
    first = np.asarray(positions["shoulder"])
    second = first + positions["elbow"]
    elbow = 0.4 * np.stack((np.cos(first), np.sin(first)), axis=-1)
    tip = elbow + 0.4 * np.stack((np.cos(second), np.sin(second)), axis=-1)
    return np.stack((np.zeros_like(tip), elbow, tip), axis=-2)


PRESENT = {"shoulder": 0.0, "elbow": 2.5, "torso": 0.1}
WAVE = Motion(("elbow", "shoulder"), ((0.3, 0.8), (-0.5, 1.4), (1.0, -1.0)))


def seen(*points):
    at = np.array(points, float).reshape(-1, 2)
    return Obstacles(at, np.zeros(len(at), int), ("scan",), ("scan",))


def gaps(obstacles):
    return np.hypot(*obstacles.points.T) - 0.27


def outline(motion, present, pieces=120):
    """The arm's outline (N, 2) and middle line at all moments, in much smaller steps than the sweep."""
    way = np.array([[present[joint] for joint in motion.joints], *motion.points])
    moments = np.concatenate([np.linspace(*ends, pieces) for ends in pairwise(way)])
    lines = two_links({**present, **dict(zip(motion.joints, moments.T, strict=True))})
    begin, end = lines[:, :-1, None], lines[:, 1:, None]
    middles = (begin + np.linspace(0.0, 1.0, 21)[:, None] * (end - begin)).reshape(-1, 2)
    rim = [middles + RADIUS_M * np.array((math.cos(a), math.sin(a))) for a in np.arange(0.0, math.tau, 0.4)]
    return np.concatenate(rim), middles


@pytest.mark.parametrize(
    "motion", [WAVE, Motion(WAVE.joints, ((2.4, 3.0),)), Motion(WAVE.joints, ((0.0, 0.0), (0.0, 3.0)))]
)
def test_the_arm_stays_within_its_sweep(motion):
    discs = np.array(swept(motion, PRESENT, two_links, RADIUS_M))
    rim, middles = outline(motion, PRESENT)
    deepest = np.full(len(rim), -math.inf)
    for x, y, radius in discs:
        np.maximum(deepest, radius - np.hypot(rim[:, 0] - x, rim[:, 1] - y), out=deepest)
    assert deepest.min() >= 0.0
    assert discs[:, 2].max() <= 1.25 * RADIUS_M + 1.5 * CELL_M
    for x, y, _ in discs:
        assert np.hypot(*(middles - (x, y)).T).min() <= CELL_M


def test_thinned_discs_cover_the_original_discs():
    many = np.random.default_rng(3).uniform(-1, 1, (3000, 2))
    few = thinned(many, RADIUS_M)
    assert len(few) <= (2.0 / CELL_M + 1) ** 2
    for x, y in many:
        assert any(math.hypot(x - a, y - b) + RADIUS_M <= r + 1e-9 for a, b, r in few)


def test_an_unreported_joint_leaves_the_sweep_unknown():
    with pytest.raises(KeyError):
        swept(WAVE, {"elbow": 0.0}, two_links, RADIUS_M)


def test_the_nearest_obstacle_in_the_sweep_is_named():
    obstacles = seen((3.0, 0.0), (0.7, 0.7), (0.5, 0.5), (-0.5, 0.0))
    found = intruder([(0.6, 0.6, 0.2)], obstacles, gaps(obstacles))
    assert found.gap_m == pytest.approx(math.hypot(0.5, 0.5) - 0.27)
    assert found.bearing_rad == pytest.approx(math.pi / 4)


def test_nothing_in_the_sweep_is_no_intruder():
    obstacles = seen((3.0, 0.0))
    assert intruder([(0.6, 0.6, 0.2)], obstacles, gaps(obstacles)) is None
    nothing = seen()
    assert intruder([(0.6, 0.6, 0.2)], nothing, gaps(nothing)) is None


def test_points_well_inside_the_arm_do_not_count():
    arm = [(0.5, 0.0, 0.12)]
    below, edge = seen((0.5, 0.02)), seen((0.5, 0.1))
    assert intruder([(0.5, 0.0, 0.3)], below, gaps(below), arm) is None
    assert intruder([(0.5, 0.0, 0.3)], edge, gaps(edge), arm) is not None
