"""Check for the certificates whether a box about the base holds a point."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from robots.shared.geometry.arc import Metres
from robots.shared.geometry.planar import Points

GUESSES = 3  # points to remember: a decision checks three boxes


class Box(NamedTuple):
    """A box about the base origin, along a direction of travel: metres ahead, behind, and to either side.

    `rounded`: the radius of its corners, no longer than any side.
    """

    ahead: float
    behind: float
    aside: float
    rounded: float = 0.0


class Corridors:
    """Checks whether boxes about the robot are empty. Holds the points (base frame).

    `guesses`: rows of points that were in earlier boxes. They are checked first, because a box mostly holds
    the same point as before. A wrong guess costs time only.
    """

    def __init__(self, points: Points, guesses: Sequence[int] = ()) -> None:
        self._points = points
        self._tried = [self._at(row) for row in guesses if row < len(points)]

    @property
    def met(self) -> list[int]:
        """Rows of points that were in boxes, the newest first."""
        return [row for row, _, _ in self._tried]

    def _at(self, row: int) -> tuple[int, float, float]:
        x, y = self._points[row].tolist()
        return row, x, abs(y)

    @cached_property
    def _aside(self) -> Metres:
        return np.abs(self._points[:, 1])

    def are_clear(self, box: Box, *, reverse: bool = False) -> bool:
        """Return whether no point is in the box or on its border. A NaN point is in no box.

        `reverse`: the box points backwards.
        """
        ahead, behind = (box.behind, box.ahead) if reverse else (box.ahead, box.behind)
        aside, rounded = box.aside, box.rounded
        for _, x, y in self._tried:
            off_x, off_y = max(x - ahead, -behind - x) + rounded, y - aside + rounded
            if (
                off_x <= rounded
                and off_y <= rounded
                and (off_x <= 0.0 or off_y <= 0.0 or math.hypot(off_x, off_y) <= rounded)
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
        # Distances beyond the straight parts of the sides; a point beyond both of them is in a corner.
        beyond_x = np.maximum(np.maximum(x_in - (ahead - rounded), (rounded - behind) - x_in), 0.0)
        beyond_y = np.maximum(y_in - (aside - rounded), 0.0)
        squares = beyond_x * beyond_x + beyond_y * beyond_y
        row = int(squares.argmin())
        if rounded and squares[row] > rounded * rounded:
            return True
        self._tried = [self._at(int(rows[row])), *self._tried[: GUESSES - 1]]
        return False
