"""What the simulated robots are made of: hull, sensors and where they sit. Data, base frame, metres, radians."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from robots.simulator.base import TIAGO as TIAGO_LIMITS
from robots.simulator.base import BaseLimits


@dataclass(frozen=True)
class Part:
    """An upright cylinder of the hull."""

    name: str
    at: tuple[float, float]
    radius: float
    bottom: float
    top: float


@dataclass(frozen=True)
class LaserMount:
    """A planar laser: pose (x, y, z, yaw) and what it can see."""

    frame: str = "base_laser_link"
    pose: tuple[float, float, float, float] = (0.202, 0.0, 0.0945, 0.0)
    half_angle: float = math.radians(110.0)
    rays: int = 666
    shortest_m: float = 0.05
    longest_m: float = 25.0
    sigma_m: float = 0.01
    dropout_share: float = 0.004


@dataclass(frozen=True)
class SonarMount:
    """A sonar: frame, pose (x, y, z, yaw), cone and reach."""

    frame: str
    pose: tuple[float, float, float, float]
    fov: float = 0.5
    shortest_m: float = 0.02
    longest_m: float = 1.0


TIAGO_SONARS = (
    SonarMount("base_sonar_01_link", (-0.183, -0.183, 0.2715, math.radians(225.0))),
    SonarMount("base_sonar_02_link", (-0.259, 0.0, 0.2715, math.radians(180.0))),
    SonarMount("base_sonar_03_link", (-0.183, 0.183, 0.2715, math.radians(135.0))),
)

_BASE = Part("base", (0.0, 0.0), 0.27, 0.0, 0.30)


@dataclass(frozen=True)
class Body:
    """One kind of robot."""

    mass_kg: float
    parts: tuple[Part, ...]
    limits: BaseLimits
    laser: LaserMount = field(default_factory=LaserMount)
    sonars: tuple[SonarMount, ...] = ()
    upper_body: bool = False  # torso, head, arm: joints, camera, speech and motions


BODIES: dict[str, Body] = {
    "tiago": Body(
        mass_kg=70.0,
        # With the arm folded the upper body stays within the base's circle; a table top meets it all the same.
        parts=(
            _BASE,
            Part("torso", (-0.06, 0.0), 0.19, 0.30, 1.0),
            Part("folded arm", (0.09, 0.0), 0.18, 0.55, 0.95),
            Part("head", (-0.03, 0.0), 0.13, 1.0, 1.15),
        ),
        limits=TIAGO_LIMITS,
        sonars=TIAGO_SONARS,
        upper_body=True,
    ),
    "pmb2": Body(mass_kg=40.0, parts=(_BASE,), limits=TIAGO_LIMITS, sonars=TIAGO_SONARS),
    "generic_diff": Body(
        mass_kg=30.0,
        parts=(_BASE,),
        limits=BaseLimits(forward_mps=0.8, reverse_mps=0.4, turn_radps=1.8),
    ),
    "generic_omni": Body(
        mass_kg=30.0,
        parts=(_BASE,),
        limits=BaseLimits(forward_mps=0.8, reverse_mps=0.8, lateral_mps=0.5, turn_radps=1.8),
    ),
}
