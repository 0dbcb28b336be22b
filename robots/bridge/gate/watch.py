"""Watches a robot that drives itself: by its measured velocity, with the obstacles and the roll-out of the gate.

While it may still brake clear of everything that the gate knows, it drives on. In place of a command, the measured
velocity is played, until zeros take effect. The latency is the profile's with its spare: a measured one says how late
commands of people take effect, and there are none here.

One source counts less than for a person's command: an echo of a sonar that is remembered and no longer heard, at a
place ahead that the laser or a fresh depth picture covers. A sonar tells the distance of an echo only, its place may be
anywhere on an arc. A person may look and press Forget; navigation would stop at it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.gate import Gate
from robots.bridge.gate.motion.rollout import Sent
from robots.bridge.gate.motion.safe_twist import is_still
from robots.bridge.gate.timing.freshness import DEPTH_STALE_S
from robots.bridge.gate.values import STILL, Obstacles, Verdict

LONG_AGO_S = 10.0  # the measured velocity is in effect for longer than any latency
AHEAD_RAD = math.radians(75.0)  # bearings from the base's middle: a sonar behind hears no place ahead of this


def judge(gate: Gate, now_s: float) -> Verdict:
    """Return the verdict on the measured velocity: "free", else the rule by which the robot must brake now."""
    moving = gate._velocity
    if fault := gate.fault(now_s):
        return Verdict(STILL, moving, fault.code, f"stopped: {fault.text}", fault.sensor)
    if is_still(moving):
        return Verdict(moving, moving, "free", "")
    parameters = gate.profile.parameters
    profile = gate._with_latency_of(parameters.latency_s + parameters.latency_spare_s)
    obstacles = _without_old_echoes(gate, gate.obstacles(now_s), now_s)
    for hull, near in gate._hulls(obstacles):
        rolled = gate._rolled_out(moving, [Sent(moving, LONG_AGO_S)], hull, near, profile)
        if rolled.cause is not None:
            return gate._restrained(moving, moving, STILL, rolled.cause)
    return Verdict(moving, moving, "free", "")


def _without_old_echoes(gate: Gate, obstacles: Obstacles, now_s: float) -> Obstacles:
    echoes = obstacles.source == gate._sources.index(gate._echoes)
    if not echoes.any():
        return obstacles
    kept = ~(echoes & _covered(gate, obstacles, now_s))
    return obstacles._replace(points=obstacles.points.T[:, kept].T, source=obstacles.source[kept])


def _covered(gate: Gate, obstacles: Obstacles, now_s: float) -> NDArray[np.bool_]:
    """Return which points lie ahead, where the laser looks or a fresh depth picture looks."""
    bearings = np.arctan2(obstacles.points[:, 1], obstacles.points[:, 0])
    ahead: NDArray[np.bool_] = np.abs(bearings) < AHEAD_RAD
    seen = any(laser.covers(0.0) for laser in gate._lasers.values())
    if gate._depth is not None:
        age_s = gate._depth.freshness.age_s(now_s)
        seen = seen or (age_s is not None and age_s <= DEPTH_STALE_S)
    return ahead if seen else np.zeros_like(ahead)
