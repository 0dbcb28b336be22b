"""Distance of the nearest point ahead and behind, for corridors of every width: computed once, read quickly.

A command finds the processor's caches cold: a pass over all points then costs ten times as much as in a loop. So
the points are processed on arrival, and a command reads two numbers.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robots.bridge.gate.geometry.planar import Points

STRIP_M = 0.025
STRIPS = 80  # to either side: corridors of up to 2 m half width
_PER_M = 1.0 / STRIP_M


class Box(NamedTuple):
    """A part of the plane about the base origin, along a way: metres ahead, behind, and to either side."""

    ahead: float
    behind: float
    aside: float


class Corridors(NamedTuple):
    """The nearest points in front (x >= 0) and in the rear, up to the n-th strip from the base's middle line."""

    front: list[float]
    rear: list[float]

    @classmethod
    def among(cls, points: Points) -> Corridors:
        """All corridors among these points (base frame). A NaN point is in none."""
        x, y = points.T
        strips = (np.fmin(np.abs(y), 2.0 * STRIPS * STRIP_M) * _PER_M).astype(np.intp)
        np.minimum(strips, STRIPS, out=strips)
        strips += (STRIPS + 1) * (x < 0.0)  # numpy is quick at one index, not at two
        nearest = np.full(2 * (STRIPS + 1), np.inf)
        np.fmin.at(nearest, strips, np.abs(x))
        front, rear = np.minimum.accumulate(nearest.reshape(2, -1), axis=1).tolist()
        return cls(front, rear)

    def are_clear(self, box: Box, *, reverse: bool = False) -> bool:
        """Return whether no point is in the box, or on its border; in reverse its way points backwards."""
        strip = int(box.aside * _PER_M)
        if strip >= STRIPS:
            return False
        ahead, behind = (self.rear, self.front) if reverse else (self.front, self.rear)
        return ahead[strip] > box.ahead and behind[strip] > box.behind
