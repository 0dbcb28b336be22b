"""The gate's answer to a command."""

from __future__ import annotations

from typing import Literal, NamedTuple

from robots.shared.geometry.poses import Velocity

# One eighth of the circle around the robot.
Side = Literal["ahead", "ahead left", "left", "behind left", "behind", "behind right", "right", "ahead right"]

# bend: the way leaves the depth picture; turn: the corners of a turning base move to the sides
Way = Literal["forward", "left", "reverse", "right", "bend", "turn"]


class SpeedLimit(NamedTuple):
    """A limit on speed: a verdict's code, words, m/s. `way`: the only way that it limits; None: all."""

    code: str
    text: str
    mps: float
    way: Way | None = None


class Verdict(NamedTuple):
    """The allowed twist, and the reason if it is less than asked.

    `code`: "idle" (nothing asked), "free", or the rule that reduces the twist. `way`: as in `SpeedLimit`, if
    a speed limit reduces it. `limits`: limits for every command; `Gate.decide` leaves them empty,
    `Gate.limits` returns them. `neutral`: after this stop (stale or missing data) the stick must return to
    neutral.
    """

    velocity: Velocity
    asked: Velocity
    code: str
    text: str
    sensor: str | None = None
    distance_m: float | None = None
    bearing_rad: float | None = None  # of the obstacle, base frame
    side: Side | None = None
    point: tuple[float, float] | None = None
    limits: tuple[SpeedLimit, ...] = ()
    neutral: bool = False
    way: Way | None = None
