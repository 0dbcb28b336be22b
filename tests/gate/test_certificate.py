"""A certificate never passes a twist that the full computation would reduce: both are compared."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest

from robots.bridge.gate import gate as gate_module
from robots.bridge.gate.gate import Gate
from robots.bridge.gate.geometry.arm_discs import AT_HOME, Posture
from robots.bridge.gate.geometry.footprint import footprint_of
from robots.bridge.gate.motion.certificate import plays_clear, restrains_nothing
from robots.bridge.gate.motion.corridors import Box, Corridors
from robots.bridge.gate.motion.rollout import Sent, safe_share
from robots.bridge.gate.motion.safe_twist import restrain
from robots.bridge.gate.values import STILL, LaserScan, Limits, Parameters, Pose, Velocity
from tests.gate.conftest import LASER, SONARS, box_profile, tiago_profile

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


# --- gates with and without certificates ------------------------------------------------------------


class World:
    """A robot drifts among posts and a wall; some posts move, and sensors fail sometimes."""

    def __init__(self, random):
        self._random = random
        count = random.integers(1, 8)
        self._posts = random.uniform(-4.0, 4.0, (count, 2))
        self._walk = np.where(random.random((count, 1)) < 0.2, random.uniform(-1.0, 1.0, (count, 2)), 0.0)
        self._wall_m = random.uniform(1.0, 8.0)
        self._pose = Pose(0.0, 0.0, 0.0)
        self._velocity = STILL
        self._silent_s = 0.0
        self.now_s = 100.0

    def step(self, gates, sent):
        random, now_s = self._random, self.now_s + 0.02
        self.now_s = now_s
        if random.random() < 0.005:
            self._silent_s = now_s + random.choice([0.1, 0.3, 0.8])
        if random.random() < 0.003:
            self._pose = self._pose._replace(x=self._pose.x + 1.0)
        self._posts += 0.02 * self._walk
        self._follow(sent)
        tick = round(now_s / 0.02)
        for gate in gates:
            gate.observe_odometry(now_s, now_s, self._pose, self._velocity)
        if tick % 5 == 0 and now_s > self._silent_s:
            scan = LaserScan(LASER, now_s, now_s, self._ranges(), -1.6, 3.2 / 180, 0.05, 25.0)
            for gate in gates:
                gate.observe_scan(scan)
        if tick % 7 == 0:
            for name in gates[0].profile.sonar_poses:
                range_m = float(random.uniform(0.2, 9.0))
                for gate in gates:
                    gate.observe_range(name, now_s, now_s, range_m, 1.0)
        arm = AT_HOME if tick % 400 < 300 else Posture(at_home=False, discs=((0.5, 0.1, 0.1),))
        for gate in gates:
            gate.observe_posture(arm, now_s)

    def _follow(self, sent):
        now = self._velocity
        vx = now.vx + float(np.clip(sent.vx - now.vx, -0.05, 0.05))
        w = now.w + float(np.clip(sent.w - now.w, -0.1, 0.1))
        x, y, yaw = self._pose
        self._velocity = Velocity(vx, float(self._random.normal(0.0, 1e-3)), w)
        self._pose = Pose(x + 0.02 * vx * math.cos(yaw), y + 0.02 * vx * math.sin(yaw), yaw + 0.02 * w)

    def _ranges(self):
        angles = -1.6 + 3.2 / 180 * np.arange(181)
        x, y, yaw = self._pose
        headings = angles + yaw
        ahead = (self._wall_m - x) / np.cos(headings)
        ranges = np.where(ahead > 0.0, ahead, np.inf)
        for post_x, post_y in self._posts - (x, y):
            off = np.remainder(np.arctan2(post_y, post_x) - headings + math.pi, math.tau) - math.pi
            far_m = math.hypot(post_x, post_y)
            ranges[np.abs(off) < 0.1 / max(far_m, 0.1)] = far_m
        return ranges + self._random.normal(0.0, 0.01, 181)


@pytest.mark.parametrize("seed", range(12))
def test_with_and_without_certificates_the_gate_says_the_same(seed, monkeypatch):
    random = np.random.default_rng(seed)
    facts = {"sonar_poses": SONARS, "sonar_fov": dict.fromkeys(SONARS, 0.5), "has_arm": seed % 3 == 0}
    profile = (box_profile if seed % 2 else tiago_profile)(**facts)
    short, full = Gate(profile), Gate(profile)
    world, sent, stick, said = World(random), STILL, STILL, Counter()
    real = {name: getattr(gate_module, name) for name in ("plays_clear", "restrains_nothing")}

    def noted(name):
        def certify(*facts):
            answer = real[name](*facts)
            said[name, answer] += 1
            return answer

        return certify

    for tick in range(500):
        if tick % 40 == 0:
            stick = Velocity(random.uniform(-0.5, 1.0), 0.0, random.uniform(-0.5, 0.5))
        world.step((short, full), sent)
        short.obstacles(world.now_s)
        for name in real:
            monkeypatch.setattr(gate_module, name, noted(name))
        verdict = short.decide(stick, sent, world.now_s)
        for name in real:
            monkeypatch.setattr(gate_module, name, lambda *_facts: False)
        assert verdict == full.decide(stick, sent, world.now_s)
        assert short.limits(world.now_s) == full.limits(world.now_s)
        sent = verdict.velocity
        if verdict.neutral:
            stick = STILL
    assert len(said) == 4, said  # both say yes and no at least once
