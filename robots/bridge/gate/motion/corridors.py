"""Boxes about the base, and whether one holds a point: the question of every certificate."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from robots.bridge.gate.geometry.arc import Metres
from robots.bridge.gate.geometry.planar import Points


class Box(NamedTuple):
    """A part of the plane about the base origin, along a way: metres ahead, behind, and to either side."""

    ahead: float
    behind: float
    aside: float


class Corridors:
    """The points (base frame) along all ways straight ahead and back. Most decisions ask for no more than one box."""

    def __init__(self, points: Points) -> None:
        self._points = points

    @cached_property
    def _aside(self) -> Metres:
        return np.abs(self._points[:, 1])

    def are_clear(self, box: Box, *, reverse: bool = False) -> bool:
        """Return whether no point is in the box, or on its border; in reverse its way points backwards.

        A NaN point is in none.
        """
        ahead, behind = (box.behind, box.ahead) if reverse else (box.ahead, box.behind)
        x = self._points[:, 0]
        within = self._aside <= box.aside
        within &= x <= ahead
        within &= x >= -behind
        return not np.logical_or.reduce(within)
