"""The gait of a person: two shins, of which one stands while the other swings.

A laser 9 cm above the floor sees the shins just above the ankles. A shin stands for 60 % of a stride. Then it
swings, over a third of the stride at two and a half times the person's speed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

STEP_S = 0.01  # between two moments of a walk
_STEP_M = 0.02  # between two points of a way
_STANDS = 0.6  # share of a stride (two steps) in which a shin stands
_USUAL_MPS, _USUAL_STEP_M = 1.2, 0.65  # length of an adult's step
_FASTER = 0.42  # exponent: a faster person takes longer and quicker steps


class Build(NamedTuple):
    """Sizes of a person, metres. `step_share`: length of a step, relative to an adult's."""

    shin_m: float  # radius
    apart_m: float  # from the middle of the way to a shin
    trunk_m: float  # radius
    step_share: float


class Way(NamedTuple):
    """Points every 2 cm along the middle of a person's way, with headings (rad)."""

    x: Floats
    y: Floats
    heading: Floats

    def at(self, length_m: Floats) -> tuple[Floats, Floats, Floats]:
        """Return places and headings at lengths along the way; beyond its ends it goes on straight."""
        last = len(self.x) - 1
        row = np.clip(length_m / _STEP_M, 0.0, last)
        nearest = np.rint(row).astype(np.intp)
        over = length_m - _STEP_M * nearest
        heading = self.heading[nearest]
        return self.x[nearest] + over * np.cos(heading), self.y[nearest] + over * np.sin(heading), heading


def way(length_m: float, turn: float, turns_at_m: float, turns_within_m: float) -> Way:
    """Return a way from the origin along x, that turns by `turn` (rad) from `turns_at_m` on."""
    along = np.arange(0.0, length_m + _STEP_M, _STEP_M)
    heading = turn * np.clip((along - turns_at_m) / turns_within_m, 0.0, 1.0)
    x = np.concatenate(([0.0], np.cumsum(_STEP_M * np.cos(heading[:-1]))))
    y = np.concatenate(([0.0], np.cumsum(_STEP_M * np.sin(heading[:-1]))))
    return Way(x, y, heading)


def moved(path: Way, x: float, y: float, heading: float, length_m: float) -> Way:
    """Return the way, moved and turned so that it passes (x, y) with this heading after `length_m`."""
    (at_x,), (at_y,), (was,) = path.at(np.array([length_m]))
    turn = heading - was
    cos, sin = math.cos(turn), math.sin(turn)
    dx, dy = path.x - at_x, path.y - at_y
    return Way(x + cos * dx - sin * dy, y + sin * dx + cos * dy, path.heading + turn)


@dataclass(frozen=True)
class Walk:
    """A person's walk: `length_m` along `way` at each moment, every `STEP_S`."""

    build: Build
    way: Way
    length_m: Floats
    step_m: float
    ahead_m: float = 0.0  # this person walks that far ahead of the way's moment,
    left_m: float = 0.0  # and that far to its left

    def trunk(self, time_s: float) -> tuple[float, float, float]:
        """Return the trunk's place and heading at a time."""
        x, y, heading = self._trunks[self._row(time_s)].tolist()
        return x, y, heading

    def shins(self, time_s: float) -> Floats:
        """Return the places of both shins at a time, (2, 2)."""
        at: Floats = self._shins[self._row(time_s)]
        return at

    def _row(self, time_s: float) -> int:
        return min(max(round(time_s / STEP_S), 0), len(self.length_m) - 1)

    @cached_property
    def _trunks(self) -> Floats:
        x, y, heading = self.way.at(self.length_m + self.ahead_m)
        return np.stack(
            (x - self.left_m * np.sin(heading), y + self.left_m * np.cos(heading), heading), axis=1
        )

    @cached_property
    def _shins(self) -> Floats:
        feet = []
        for foot, aside_m in enumerate((self.build.apart_m, -self.build.apart_m)):
            x, y, heading = self.way.at(self._foot(self.length_m + self.ahead_m, foot))
            left_m = self.left_m + aside_m
            feet.append(np.stack((x - left_m * np.sin(heading), y + left_m * np.cos(heading)), axis=1))
        return np.stack(feet, axis=1)

    def _foot(self, length_m: Floats, foot: int) -> Floats:
        """Return where a foot is along the way: it stands about multiples of two steps, and swings between."""
        stride_m = 2.0 * self.step_m
        offset_m = foot * self.step_m
        stands_m = _STANDS * stride_m
        number, since_m = np.divmod(length_m - offset_m + stands_m / 2.0, stride_m)
        swung = np.maximum(since_m - stands_m, 0.0) / (stride_m - stands_m)
        places: Floats = number * stride_m + offset_m + stride_m * (0.5 - 0.5 * np.cos(math.pi * swung))
        return places


def step_length(speed_mps: float, build: Build) -> float:
    """Return the length of a step (m) at a speed."""
    return build.step_share * _USUAL_STEP_M * math.pow(speed_mps / _USUAL_MPS, _FASTER)
