"""The share of a twist with which braking ends in time (docs/gate.md, 2 and 3).

Scaling a twist keeps its arc. A twist scaled by s needs s T of its own time to take effect and s^2 T_b / 2 to brake.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.geometry.arc import speed
from robots.bridge.gate.values import GateProfile, Velocity


def deceleration(profile: GateProfile) -> tuple[float, float]:
    """Usable deceleration: a in m/s^2 and alpha in rad/s^2."""
    share = profile.parameters.deceleration_share
    return share * profile.limits.linear_mps2, share * profile.limits.angular_radps2


def braking_time(twist: Velocity, profile: GateProfile) -> float:
    """T_b = max(|v| / a, |w| / alpha), seconds from full twist to standstill."""
    linear, angular = deceleration(profile)
    return max(speed(twist) / linear, abs(twist.w) / angular)


def horizon(twist: Velocity, profile: GateProfile) -> float:
    """Seconds of the unscaled twist that latency and braking use up: contacts later than this limit nothing."""
    return profile.parameters.latency_s + braking_time(twist, profile) / 2.0


def scale(until_contact_s: float, latency_s: float, braking_time_s: float) -> float:
    """s = (-T + sqrt(T^2 + 2 T_b tau)) / T_b, clipped to 0..1; tau is `until_contact_s`, less the reserve."""
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
    """The speed v now from which u = `there_mps` can be reached within `distance_m`; at least u.

    v T + (v^2 - u^2) / 2a = distance.
    """
    reaction = deceleration_mps2 * latency_s
    now = np.sqrt(reaction**2 + 2.0 * deceleration_mps2 * distance_m + there_mps**2) - reaction
    return np.maximum(now, there_mps)


def way_between(now_mps: float, there_mps: float, latency_s: float, deceleration_mps2: float) -> float:
    """The distance in which a speed is reached from a higher one: v T + (v^2 - u^2) / 2a."""
    return now_mps * latency_s + (now_mps**2 - there_mps**2) / (2.0 * deceleration_mps2)


def speed_for(latency_s: float, full_mps: float, assumed_s: float, deceleration_mps2: float) -> float:
    """The speed from which a robot that obeys after `latency_s` stops as short as from `full_mps` after `assumed_s`.

    v T + v^2 / 2a = V T_0 + V^2 / 2a, in m/s; at most `full_mps`.
    """
    way_m = full_mps * assumed_s + full_mps**2 / (2.0 * deceleration_mps2)
    return min(speed_within(way_m, latency_s, deceleration_mps2), full_mps)


def speed_within(way_m: float, latency_s: float, deceleration_mps2: float) -> float:
    """The speed (m/s) from which a robot stops within `way_m`: v T + v^2 / 2a = way."""
    reaction = deceleration_mps2 * latency_s
    return math.sqrt(reaction**2 + 2.0 * deceleration_mps2 * way_m) - reaction
