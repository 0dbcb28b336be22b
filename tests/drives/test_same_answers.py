"""Whole drives with and without certificates: the gate gives the same answers, only sooner."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest

from robots.bridge.gate import gate as gate_module
from robots.bridge.gate.arm.discs import AT_HOME, Posture
from robots.bridge.gate.gate import Gate
from robots.bridge.gate.values import LaserScan
from robots.shared.geometry.poses import STILL, Pose, Velocity
from tests.gate.conftest import LASER, SONARS, box_profile, tiago_profile


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
    assert len(said) == 4, said  # both certificates answered yes and no at least once
