"""Compute the share of a twist with which braking ends in time (docs/gate.md, 2 and 3).

Scaling a twist keeps its arc. A twist scaled by s moves as far during the latency as the unscaled twist in
the time s T, and as far during braking as the unscaled twist in the time s^2 T_b / 2.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robots.shared.configuration.gate_profile import GateProfile
from robots.shared.geometry.arc import speed
from robots.shared.geometry.poses import Velocity


def deceleration(profile: GateProfile) -> tuple[float, float]:
    """Return the usable decelerations: a in m/s^2 and alpha in rad/s^2."""
    share = profile.parameters.deceleration_share
    return share * profile.limits.linear_mps2, share * profile.limits.angular_radps2


def braking_time(twist: Velocity, profile: GateProfile) -> float:
    """Return T_b = max(|v| / a, |w| / alpha), the seconds from the full twist to standstill."""
    linear, angular = deceleration(profile)
    return max(speed(twist) / linear, abs(twist.w) / angular)


def horizon(twist: Velocity, profile: GateProfile) -> float:
    """Return the time (s) at the speed of the twist for latency and braking. Later contacts limit nothing."""
    return profile.parameters.latency_s + braking_time(twist, profile) / 2.0


def scale(until_contact_s: float, latency_s: float, braking_time_s: float) -> float:
    """Return s = (-T + sqrt(T^2 + 2 T_b tau)) / T_b, clipped to 0..1.

    tau is `until_contact_s`, from which the reserve is already subtracted.
    """
    if until_contact_s <= 0.0:
        return 0.0
    if until_contact_s >= latency_s + braking_time_s / 2.0:
        return 1.0
    root = math.sqrt(latency_s**2 + 2.0 * braking_time_s * until_contact_s)
    return min((root - latency_s) / braking_time_s, 1.0)


def speed_before(
    distance_m: NDArray[np.float64],
    there_mps: NDArray[np.float64],
    latency_s: float,
    deceleration_mps2: float,
) -> NDArray[np.float64]:
    """Return the speed v from which the robot can brake to u = `there_mps` within `distance_m`; at least u.

    v T + (v^2 - u^2) / 2a = distance.
    """
    reaction = deceleration_mps2 * latency_s
    now = np.sqrt(reaction**2 + 2.0 * deceleration_mps2 * distance_m + there_mps**2) - reaction
    return np.maximum(now, there_mps)


def slowing_distance(now_mps: float, there_mps: float, latency_s: float, deceleration_mps2: float) -> float:
    """Return the distance (m) for braking from `now_mps` to `there_mps`: v T + (v^2 - u^2) / 2a."""
    return now_mps * latency_s + (now_mps**2 - there_mps**2) / (2.0 * deceleration_mps2)


def speed_for(latency_s: float, full_mps: float, assumed_s: float, deceleration_mps2: float) -> float:
    """Return the speed v (m/s) at which a robot with latency T = `latency_s` has the usual stopping distance.

    v T + v^2 / 2a = V T_0 + V^2 / 2a with V = `full_mps` and T_0 = `assumed_s`; v is at most V.
    """
    distance_m = full_mps * assumed_s + full_mps**2 / (2.0 * deceleration_mps2)
    return min(speed_within(distance_m, latency_s, deceleration_mps2), full_mps)


def speed_within(distance_m: float, latency_s: float, deceleration_mps2: float) -> float:
    """Return the speed (m/s) from which a robot stops within `distance_m`: v T + v^2 / 2a = distance."""
    reaction = deceleration_mps2 * latency_s
    return math.sqrt(reaction**2 + 2.0 * deceleration_mps2 * distance_m) - reaction
