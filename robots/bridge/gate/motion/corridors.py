"""Boxes about the base, and whether one holds a point: the question of every certificate."""

from __future__ import annotations

import math
from functools import cached_property
from typing import NamedTuple

import numpy as np

from robots.bridge.gate.geometry.arc import Metres
from robots.bridge.gate.geometry.planar import Points


class Box(NamedTuple):
    """A part of the plane about the base origin, along a way: metres ahead, behind, and to either side.

    `rounded`: the radius of its corners, no longer than any side.
    """

    ahead: float
    behind: float
    aside: float
    rounded: float = 0.0


class Corridors:
    """The points (base frame) along all ways straight ahead and back. Most decisions ask for no more than one box."""

    def __init__(self, points: Points) -> None:
        self._points = points
        self._met: tuple[float, float] | None = None  # x and |y| of a point that was in the last box

    @cached_property
    def _aside(self) -> Metres:
        return np.abs(self._points[:, 1])

    def are_clear(self, box: Box, *, reverse: bool = False) -> bool:
        """Return whether no point is in the box, or on its border; in reverse its way points backwards.

        A NaN point is in none.
        """
        ahead, behind = (box.behind, box.ahead) if reverse else (box.ahead, box.behind)
        aside, rounded = box.aside, box.rounded
        if self._met is not None:  # most boxes of a decision hold the same point
            x, y = self._met
            off_x, off_y = max(x - ahead, -behind - x) + rounded, y - aside + rounded
            if max(off_x, off_y) <= rounded and (
                min(off_x, off_y) <= 0.0 or math.hypot(off_x, off_y) <= rounded
            ):
                return False
        xs = self._points[:, 0]
        within = self._aside <= aside
        within &= xs <= ahead
        within &= xs >= -behind
        if not np.logical_or.reduce(within):
            return True
        rows = within.nonzero()[0]
        x_in, y_in = xs.take(rows), self._aside.take(rows)
        # How far each lies beyond the straight parts of the sides: in a corner, if along both.
        beyond_x = np.maximum(np.maximum(x_in - (ahead - rounded), (rounded - behind) - x_in), 0.0)
        beyond_y = np.maximum(y_in - (aside - rounded), 0.0)
        squares = beyond_x * beyond_x + beyond_y * beyond_y
        row = int(squares.argmin())
        if rounded and squares[row] > rounded * rounded:
            return True
        self._met = float(x_in[row]), float(y_in[row])
        return False
