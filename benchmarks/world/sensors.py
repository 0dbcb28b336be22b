"""Sensors of a run: those of a TIAGo, or others that a seed draws.

The simulated floor has no friction: a slippery floor is drawn as wheel slip and weaker brakes. Descriptions
with missing links are drawn in `benchmarks.world.cases.arm`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from msgspec import structs

from robots.shared.configuration.gate_profile import GateProfile
from robots.simulator.sensors.body import TIAGO, Body
from robots.simulator.sensors.depth import HEIGHT, NEAREST_M, WIDTH

DEPTH_SIZES = ((80, 60), (96, 72), (160, 120), (320, 240), (640, 480))
SLIPS = 3  # one of this number of draws has wheels that slip


@dataclass(frozen=True)
class Sensors:
    """Properties of the robot's sensors; radians, metres, hertz, shares."""

    sonar_fov: float = TIAGO.sonars[0].fov
    sonar_sigma_m: float = TIAGO.sonars[0].sigma_m
    sonar_lost: float = 0.0  # of echoes
    laser_hz: float = 10.0
    laser_half: float = TIAGO.laser.half_angle
    laser_step: float = 2.0 * TIAGO.laser.half_angle / (TIAGO.laser.rays - 1)
    depth_size: tuple[int, int] = (WIDTH, HEIGHT)
    depth_hz: float = 5.0
    depth_nearest_m: float = NEAREST_M
    depth_holes: int = 0  # in each picture

    def body(self) -> Body:
        """Return a TIAGo's body with these sensors."""
        if self == STANDARD:
            return TIAGO
        rays = round(2.0 * self.laser_half / self.laser_step) + 1
        sonars = tuple(
            replace(sonar, fov=self.sonar_fov, sigma_m=self.sonar_sigma_m, lost_share=self.sonar_lost)
            for sonar in TIAGO.sonars
        )
        return replace(
            TIAGO, laser=replace(TIAGO.laser, half_angle=self.laser_half, rays=rays), sonars=sonars
        )

    def profile(self, known: GateProfile) -> GateProfile:
        """Return `known` with the only property that the console knows: the width of the sonars' cones."""
        return structs.replace(known, sonar_fov=dict.fromkeys(known.sonar_fov, self.sonar_fov))

    @classmethod
    def drawn(cls, random: np.random.Generator) -> Sensors:
        """Draw sensors that a robot may have."""
        return cls(
            sonar_fov=math.radians(random.uniform(15.0, 60.0)),
            sonar_sigma_m=float(random.uniform(0.01, 0.05)),
            sonar_lost=0.3,
            laser_hz=float(random.uniform(5.0, 25.0)),
            laser_half=math.radians(random.uniform(90.0, 135.0)),
            laser_step=math.radians(random.uniform(0.25, 1.0)),
            depth_size=DEPTH_SIZES[int(random.integers(len(DEPTH_SIZES)))],
            depth_hz=float(random.uniform(5.0, 30.0)),
            depth_nearest_m=float(random.uniform(0.3, 0.5)),
            depth_holes=int(random.integers(0, 6)),
        )

    def __str__(self) -> str:
        width, height = self.depth_size
        return (
            f"sonar {math.degrees(self.sonar_fov):.0f} deg, noise {100 * self.sonar_sigma_m:.1f} cm; "
            f"laser {self.laser_hz:.0f} Hz, {math.degrees(2 * self.laser_half):.0f} deg, "
            f"{math.degrees(self.laser_step):.2f} deg; depth {width}x{height}, {self.depth_hz:.0f} Hz, "
            f"from {self.depth_nearest_m:.2f} m, {self.depth_holes} holes"
        )


STANDARD = Sensors()
