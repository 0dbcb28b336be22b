"""Watches a robot that drives itself: by its measured velocity, with the obstacles and the roll-out of the gate.

While it may still brake clear of everything that the gate knows, it drives on. Two plays must be clear, until zeros
take effect and it has braked: it keeps its measured velocity; it follows what navigation sends to the base. A robot
that stands close to something shows by its velocity too late where it is about to go. The latency is the profile's with
its spare: a measured one says how late commands of people take effect, and there are none here.

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
from robots.bridge.gate.motion.safe_twist import is_finite, is_still
from robots.bridge.gate.obstacles.sonar_memory import SonarMemory
from robots.bridge.gate.timing.freshness import DEPTH_STALE_S
from robots.bridge.gate.values import STILL, Obstacles, Velocity, Verdict

LONG_AGO_S = 10.0  # the measured velocity is in effect for longer than any latency
ECHOES = SonarMemory.name
AHEAD_RAD = math.radians(75.0)  # bearings from the base's middle: a sonar behind hears no place ahead of this


def judge(gate: Gate, commanded: Velocity | None, now_s: float) -> Verdict:
    """Return the verdict on how the robot moves: "free", else the rule by which it must brake now.

    `commanded`: what navigation sends to the base, if it does.
    """
    moving = gate._velocity
    if fault := gate.fault(now_s):
        return Verdict(STILL, moving, fault.code, f"stopped: {fault.text}", fault.sensor)
    expected = [moving] if commanded is None or not is_finite(commanded) else [moving, commanded]
    if all(map(is_still, expected)):
        return Verdict(moving, moving, "free", "")
    parameters = gate.profile.parameters
    profile = gate._with_latency_of(parameters.latency_s + parameters.latency_spare_s)
    obstacles = _without_old_echoes(gate, gate.obstacles(now_s), now_s)
    for hull, near in gate._hulls(obstacles):
        for velocity in expected:
            rolled = gate._rolled_out(velocity, [Sent(velocity, LONG_AGO_S)], hull, near, profile)
            if rolled.cause is not None:
                return gate._restrained(velocity, velocity, STILL, rolled.cause)
    return Verdict(moving, moving, "free", "")


def spare_m(gate: Gate, now_s: float) -> float:
    """Return the gap to the nearest thing that is seen or remembered; sonars do not tell where it is, and do not count.

    Navigation may start towards it at any moment, and zeros take effect some centimetres later.
    """
    obstacles = gate.obstacles(now_s)
    placed = np.array(
        [
            kind != "sonar" and name != ECHOES
            for kind, name in zip(obstacles.kinds, obstacles.names, strict=True)
        ]
    )
    points = obstacles.points[placed[obstacles.source]] if len(obstacles.points) else obstacles.points
    return float(gate.footprint.gaps(points).min()) if len(points) else math.inf


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
