"""Inputs of the gate, and what it says about its sensors and its memory."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray


class LaserScan(NamedTuple):
    """An unchecked sensor_msgs/LaserScan: name of its laser, stamp, time of arrival; m, rad."""

    source: str
    stamp_s: float
    arrival_s: float
    ranges: Any
    angle_min: float
    angle_increment: float
    range_min_m: float
    range_max_m: float


# Sources of obstacles; a memory (of a laser, of the depth camera) holds earlier points that no sensor sees now.
Kind = Literal["scan", "sonar", "depth", "memory", "depth memory"]


class Obstacles(NamedTuple):
    """Points to avoid, current base frame. `points` (N, 2) float64; `source` (N,) index into `names`."""

    points: NDArray[np.float64]
    source: NDArray[np.intp]
    names: tuple[str, ...]
    kinds: tuple[Kind, ...]  # of the sources


# A sector around the base, counter-clockwise from the first bearing to the second, radians.
Sector = tuple[float, float]

# Why memory was dropped: a person asked; another publisher of the odometry, or another run of the robot's ROS; its
# stamps went back; its pose jumped; the bridge was started, so the gate is new.
ForgetCode = Literal["asked", "odometry_restarted", "stamps_back", "jump", "bridge_started"]


class Forgotten(NamedTuple):
    """An event in which the gate dropped what it remembered; `number` grows with each."""

    number: int
    code: ForgetCode


BRIDGE_STARTED = Forgotten(0, "bridge_started")


class SensorHealth(NamedTuple):
    """State of a sensor. `age_s` None: no message yet. `text` is empty while `ok`."""

    name: str
    kind: Literal["scan", "sonar", "odometry", "depth"]
    ok: bool
    age_s: float | None
    text: str
