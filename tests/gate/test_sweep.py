"""The space that an arm sweeps covers the arm at every moment of its way, and little more."""

import math
from itertools import pairwise

import numpy as np
import pytest

from robots.bridge.gate.sweep import CELL_M, Motion, intruder, swept, thinned
from robots.bridge.gate.values import Obstacles

RADIUS_M = 0.1


def two_links(positions):
    """An arm of two links of 0.4 m in the plane."""
    first = positions["shoulder"]
    second = first + positions["elbow"]
    elbow = np.array([0.4 * math.cos(first), 0.4 * math.sin(first)])
    tip = elbow + 0.4 * np.array([math.cos(second), math.sin(second)])
    return [(float(x), float(y), RADIUS_M) for x, y in (elbow, tip)]


PRESENT = {"shoulder": 0.0, "elbow": 2.5, "torso": 0.1}
WAVE = Motion(("elbow", "shoulder"), ((0.3, 0.8), (-0.5, 1.4), (1.0, -1.0)))


def seen(*points):
    at = np.array(points, float).reshape(-1, 2)
    return Obstacles(at, np.zeros(len(at), int), ("scan",), ("scan",))


def gaps(obstacles):
    return np.hypot(*obstacles.points.T) - 0.27


def covered(discs, x, y):
    return any(math.hypot(x - a, y - b) <= radius for a, b, radius in discs)


def moments(motion, present, pieces=400):
    """The arm's joints at every moment, in far smaller steps than the sweep takes."""
    way = [tuple(present[joint] for joint in motion.joints), *motion.points]
    for begin, end in pairwise(way):
        for share in np.linspace(0.0, 1.0, pieces):
            positions = (a + share * (b - a) for a, b in zip(begin, end, strict=True))
            yield {**present, **dict(zip(motion.joints, positions, strict=True))}


def test_the_arm_is_within_the_sweep_at_every_moment_and_the_sweep_near_the_arm():
    discs = swept(WAVE, PRESENT, two_links)
    middles = np.array([disc[:2] for arm in moments(WAVE, PRESENT) for disc in two_links(arm)])
    for x, y in middles:
        assert covered(discs, x, y)
    radii = {round(radius, 6) for _, _, radius in discs}
    assert max(radii) <= RADIUS_M + CELL_M
    for x, y, _ in discs:
        assert np.hypot(*(middles - (x, y)).T).min() <= CELL_M


def test_thinned_discs_cover_what_they_stand_for():
    random = np.random.default_rng(3)
    many = [(*random.uniform(-1, 1, 2), RADIUS_M) for _ in range(3000)]
    few = thinned(many)
    assert len(few) <= (2.0 / CELL_M + 1) ** 2
    for x, y, radius in many:
        assert any(math.hypot(x - a, y - b) + radius <= r + 1e-9 for a, b, r in few)


def test_a_joint_that_nobody_tells_of_leaves_the_sweep_unknown():
    with pytest.raises(KeyError):
        swept(WAVE, {"elbow": 0.0}, two_links)


def test_the_nearest_of_what_stands_in_the_sweep_is_named():
    obstacles = seen((3.0, 0.0), (0.7, 0.7), (0.5, 0.5), (-0.5, 0.0))
    found = intruder([(0.6, 0.6, 0.2)], obstacles, gaps(obstacles))
    assert found.gap_m == pytest.approx(math.hypot(0.5, 0.5) - 0.27)
    assert found.bearing == pytest.approx(math.pi / 4)


def test_nothing_in_the_sweep_is_no_intruder():
    obstacles = seen((3.0, 0.0))
    assert intruder([(0.6, 0.6, 0.2)], obstacles, gaps(obstacles)) is None
    nothing = seen()
    assert intruder([(0.6, 0.6, 0.2)], nothing, gaps(nothing)) is None


def test_what_is_well_within_the_arm_already_does_not_count_and_what_is_at_its_edge_does():
    arm = [(0.5, 0.0, 0.12)]
    below, edge = seen((0.5, 0.02)), seen((0.5, 0.1))
    assert intruder([(0.5, 0.0, 0.3)], below, gaps(below), arm) is None
    assert intruder([(0.5, 0.0, 0.3)], edge, gaps(edge), arm) is not None
