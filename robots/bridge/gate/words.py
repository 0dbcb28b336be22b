"""Sentences for the operator: sensor, side, distance, remaining speed."""

from __future__ import annotations

import math

from robots.shared.geometry.poses import Velocity
from robots.shared.records.verdict import Side, Way

SIDES: tuple[Side, ...] = (
    "ahead",
    "ahead left",
    "left",
    "behind left",
    "behind",
    "behind right",
    "right",
    "ahead right",
)
LEAST_TOLD_MPS = 0.2  # a mover's speed below is not known well enough to be said
WAYS: tuple[tuple[Way, str], ...] = (
    ("forward", "forward"),
    ("left", "to the left"),
    ("reverse", "in reverse"),
    ("right", "to the right"),
)

NOT_SEEN_NOW = (
    "no sensor sees this place now: drive away from it or turn to it; "
    "if nothing is there, press Forget what was seen"
)

FORGOTTEN = {
    "asked": "a person asked for it",
    "odometry_restarted": "its odometry or its ROS master was restarted",
    "stamps_back": "its clock was set back",
    "jump": "the pose of its odometry jumped",
    "bridge_started": "its bridge was started",
}


def forgotten(code: str) -> str:
    """Return a sentence that says why memory was dropped."""
    return f"The robot forgot what it saw before: {FORGOTTEN[code]}."


def side(bearing: float) -> Side:
    """Return the eighth of the full circle around the robot that contains a bearing (base frame, radians)."""
    return SIDES[round(bearing / (math.pi / 4.0)) % len(SIDES)]


def figure(number: float) -> str:
    """Return a distance or speed with as many digits as an operator can use: 0.6, but 0.08."""
    return f"{number:.1f}" if number >= 0.095 else f"{number:.2f}"


def age(age_s: float) -> str:
    """Return a duration in words: "0.6 s", "75 s", "14 min"."""
    if age_s < 60.0:
        return f"{age_s:.1f} s"
    return f"{age_s:.0f} s" if age_s < 120.0 else f"{age_s / 60.0:.0f} min"


def reduction(asked: Velocity, allowed: Velocity) -> str:
    """Return the difference between asked and allowed twist: "slowed from 0.8 to 0.2 m/s"."""
    speed, allowed_speed = math.hypot(asked.vx, asked.vy), math.hypot(allowed.vx, allowed.vy)
    if speed == 0.0:
        return (
            f"turning slowed {_from_to(abs(asked.w), abs(allowed.w))} rad/s" if allowed.w else "not turning"
        )
    if allowed_speed > 0.0:
        return f"slowed {_from_to(speed, allowed_speed)} m/s"
    return f"{'turning only' if allowed.w else 'stopped'} ({figure(speed)} m/s asked)"


def _from_to(asked: float, allowed: float) -> str:
    """Return two figures in words, or one if both look the same."""
    first, second = figure(asked), figure(allowed)
    return f"from {first} to {second}" if first != second else f"to {second}"


def obstacle(word: str, gap_m: float, bearing: float, rule: str, mps: float = 0.0) -> str:
    """Return the cause in words: "laser, 0.6 m ahead left", with the rule if it is not obvious."""
    return f"{_manner(rule, mps)}{word}, {figure(max(gap_m, 0.0))} m {side(bearing)}"


def _manner(rule: str, mps: float) -> str:
    if rule == "mover":
        return f"moving at {figure(mps)} m/s, " if mps >= LEAST_TOLD_MPS else "moving, "
    return "passing close, " if rule == "near_miss" else ""


def way(direction: float) -> tuple[Way, str]:
    """Return the way nearest to a direction of travel (base frame, radians), also in words: "in reverse"."""
    return WAYS[round(direction / (math.pi / 2.0)) % len(WAYS)]
