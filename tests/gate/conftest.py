"""Robots for tests of the gate: a TIAGo, and a rectangular base."""

from __future__ import annotations

import math
from unittest.mock import patch

import numpy as np
import pytest

from robots.bridge.gate.gate import Gate
from robots.bridge.gate.obstacles.point_memory import Memory
from robots.bridge.gate.timing.trail import between
from robots.bridge.gate.values import LaserScan
from robots.shared.configuration.gate_profile import GateProfile, Limits, Parameters
from robots.shared.geometry.poses import Pose, Velocity

LASER = "/scan_raw"
SONARS = {
    "base_sonar_01_link": (-0.183, -0.183, math.radians(225)),
    "base_sonar_02_link": (-0.259, 0.0, math.radians(180)),
    "base_sonar_03_link": (-0.183, 0.183, math.radians(135)),
}


def tiago_profile(**changes) -> GateProfile:
    """A TIAGo, without a depth camera unless a test adds it.

    Its sonars allow full speed in reverse, so that tests see only the limits that they test.
    """
    facts = {
        "limits": Limits(1.0, 0.2, 0.0, 2.0944, 1.0, 2.0944),
        "radius_m": 0.27,
        "outline": None,
        "scan_poses": {LASER: (0.202, 0.0, 0.0)},
        "sonar_poses": SONARS,
        "sonar_fov": dict.fromkeys(SONARS, 0.5),
        "has_depth": False,
        "blind_mps": 0.3,
        "parameters": Parameters(between_sonars_mps=1.0),
    }
    return GateProfile(**(facts | changes))


def box_profile(**changes) -> GateProfile:
    """A rectangle of 0.8 m x 0.5 m with a laser that sees in all directions."""
    facts = {
        "limits": Limits(1.0, 1.0, 0.0, 2.0, 1.0, 2.0),
        "radius_m": None,
        "outline": ((0.4, -0.25), (0.4, 0.25), (-0.4, 0.25), (-0.4, -0.25)),
        "scan_poses": {LASER: (0.0, 0.0, 0.0)},
        "sonar_poses": {},
        "sonar_fov": {},
        "has_depth": False,
        "blind_mps": 0.3,
    }
    return GateProfile(**(facts | changes))


class Feeder:
    """Feeds one gate with sensor data of a world that changes only if the test changes it."""

    def __init__(self, profile: GateProfile, ranges=None, clock_offset_s: float = 0.0) -> None:
        self.gate = Gate(profile)
        self.now_s = 100.0
        self.clock_offset_s = clock_offset_s
        self.ranges = np.full(571, math.inf) if ranges is None else np.asarray(ranges)
        self.sonar_m = math.inf
        self.pose = Pose(0.0, 0.0, 0.0)
        self.velocity = Velocity(0.0, 0.0, 0.0)
        self.previous: tuple[float, Pose] | None = None  # previous time and pose

    @property
    def stamp_s(self) -> float:
        return self.now_s + self.clock_offset_s

    @property
    def laser_memory(self) -> Memory:
        """The gate's memory of its laser's points, also of those that it hides at present."""
        return self.gate._memories[LASER]._memory

    @property
    def sonar_places(self) -> int:
        """Number of places that the gate remembers from its sonars."""
        return len(self.gate._echoes.all_places())

    @property
    def resets(self) -> int:
        """How often the gate began another frame of odometry."""
        return self.gate._trail.resets

    def odometry(self) -> None:
        """Feed odometry up to now, ten times a second: after a gap, places are uncertain."""
        began_s, pose = self.previous or (self.now_s, self.pose)
        steps = max(math.ceil((self.now_s - began_s) / 0.1 - 1e-6), 1)
        for step in range(1, steps + 1):
            share = step / steps
            now_s = self.now_s - (1.0 - share) * (self.now_s - began_s)
            here = between(pose, self.pose, share)
            self.gate.observe_odometry(now_s + self.clock_offset_s, now_s, here, self.velocity)
        self.previous = self.now_s, self.pose

    def scan(self, **changes) -> None:
        facts = {
            "stamp_s": self.stamp_s,
            "ranges": self.ranges,
            "angle_min": -math.radians(95),
            "angle_increment": math.radians(190) / 570,
            "range_min_m": 0.05,
            "range_max_m": 25.0,
        }
        self.gate.observe_scan(LaserScan(LASER, arrival_s=self.now_s, **(facts | changes)))

    def sonars(self) -> None:
        for name in SONARS:
            self.gate.observe_range(name, self.stamp_s, self.now_s, self.sonar_m, 1.0)

    def all(self) -> None:
        self.odometry()
        self.scan()
        self.sonars()

    def stay(self, seconds: float) -> None:
        """Feed what the sensors see for this time: what appeared before is furniture then, and no person."""
        for _ in range(round(seconds / 0.1)):
            self.now_s += 0.1
            self.all()

    def ahead_at(self, distance_m: float, half_width_beams: int = 12) -> None:
        """Put an obstacle in front of the laser at this distance from the laser."""
        self.ranges = np.full(571, math.inf)
        self.ranges[285 - half_width_beams : 286 + half_width_beams] = distance_m

    def decide(self, vx: float = 0.0, vy: float = 0.0, w: float = 0.0):
        """Decide as if the same twist was sent before: no acceleration step, no pending acknowledgement."""
        asked = Velocity(vx, vy, w)
        with patch.object(self.gate.latency, "sent"):
            verdict = self.gate.decide(asked, asked, self.now_s)
        return verdict._replace(limits=self.gate.limits(self.now_s))


@pytest.fixture
def tiago() -> Feeder:
    """A TIAGo in an empty hall with fresh sensor data."""
    feeder = Feeder(tiago_profile())
    feeder.all()
    return feeder
