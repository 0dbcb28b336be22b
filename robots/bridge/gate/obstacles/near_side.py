"""Places in a depth camera's blind range count as unseen, not as free.

A camera such as the Xtion measures nothing within half a metre. If the robot was parked at a table, the
camera shows only the far part of the table; no picture shows its near edge. So the gate assumes that an
obstacle at the border of the blind range reaches to the robot, unless a picture from farther away showed its
near edge. The assumption lasts while the obstacle is remembered and out of the picture, also when the robot
turns or the pictures end.

A *top* is a column of the picture that may be a part of such an obstacle: flat, and next to the blind range.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.geometry.footprint import Footprint
from robots.bridge.gate.geometry.planar import (
    NO_POINTS,
    ORIGIN,
    Points,
    chosen,
    from_columns,
    placed,
    relative_to,
)
from robots.bridge.gate.obstacles.point_memory import DEPTH_LAYER, Memory
from robots.bridge.gate.sensing.depth import CELL_M, Columns, Transform
from robots.bridge.gate.values import Pose

Flags = NDArray[np.bool_]

STEP_M = 2.0 * CELL_M  # at the place that is nearer by this, a picture would show whether the obstacle ends
FLAT_M = 0.10  # a taller column is a vertical face: its near side was measured
ASIDE_M = 1.5 * CELL_M  # an edge this near to the line from a top to the robot belongs to the same obstacle
SAME_M = 0.06  # largest distance between an edge and its remembered place
HULL_M = 0.02  # nearer places are assumed free: the robot would have touched the obstacle
NEAR_M = 1.5  # from the base, largest distance of edges and hidden places: more than any blind range


class NearSide:
    """Near edges that one camera has seen, and places that may be an obstacle's unseen near side."""

    def __init__(self, blind_m: float) -> None:
        """`blind_m`: distance along the camera's axis; the camera measures nothing nearer."""
        self._blind_m = blind_m
        self._edges = Memory(DEPTH_LAYER)
        self._tops = self._places = (
            NO_POINTS  # tops that were seen, and places to which they may reach; odometry frame
        )
        self._top_of: NDArray[np.intp] = np.empty(0, dtype=np.intp)  # of each place, its row in `_tops`

    def clear(self) -> None:
        """Forget edges and hidden places."""
        self._edges.clear()
        self._keep(np.zeros(len(self._tops), dtype=np.bool_))

    def hidden(
        self,
        shown: Columns,
        to_base: Transform,
        base: Pose,
        remembered: Points,
        body: Footprint,
        now_s: float,
    ) -> Points:
        """Return the places in the blind range of the camera that may be occupied, odometry frame.

        `shown`: the columns of its picture (base frame), taken with the camera at `to_base` and the robot at
        `base`. `remembered`: the points kept from earlier pictures (odometry frame).
        """
        reaching = self._reaches_blind_range(shown, to_base)
        places = placed(shown.points, base)
        self._edges.see(chosen(places, np.flatnonzero(~reaching)), base, now_s)
        self._forget(places, remembered, base, body)
        if reaching.any():
            there = relative_to(ORIGIN, base)
            edges = _near(placed(self._edges.points(now_s), there))
            edges = edges[_coincide(edges, _near(placed(remembered, there)))]
            self._add(_without_edge(shown.points[reaching], edges), base, body)
        return self._places

    def _forget(self, shown: Points, remembered: Points, base: Pose, body: Footprint) -> None:
        """Drop tops in the picture (they are judged again), tops that are gone, and places inside the robot."""
        if not len(self._tops):
            return
        self._keep(_coincide(self._tops, remembered) & ~_coincide(self._tops, shown))
        outside = np.flatnonzero(body.gaps(placed(self._places, relative_to(ORIGIN, base))) >= 0.0)
        self._places, self._top_of = chosen(self._places, outside), self._top_of[outside]

    def _keep(self, tops: Flags) -> None:
        """Keep only these tops and their hidden places."""
        places = np.flatnonzero(tops[self._top_of])
        self._places = chosen(self._places, places)
        self._top_of = (np.cumsum(tops) - 1)[self._top_of[places]]
        self._tops = chosen(self._tops, np.flatnonzero(tops))

    def _add(self, tops: Points, base: Pose, body: Footprint) -> None:
        """Add tops (base frame) that may reach to the robot, and their hidden places."""
        places, top_of = _filled(tops, body)
        self._places = np.concatenate((self._places, placed(places, base)))
        self._top_of = np.concatenate((self._top_of, len(self._tops) + top_of))
        self._tops = np.concatenate((self._tops, placed(tops, base)))

    def _reaches_blind_range(self, shown: Columns, to_base: Transform) -> Flags:
        """Return which columns are flat and may continue nearer, where the camera cannot measure."""
        x, y = shown.points.T
        far = np.maximum(np.hypot(x, y), STEP_M)
        x, y = x - STEP_M * x / far, y - STEP_M * y / far
        inverse = np.linalg.inv(to_base)[2]
        ahead = inverse[0] * x + inverse[1] * y + inverse[2] * shown.high + inverse[3]
        reaching: Flags = (ahead < self._blind_m) & (shown.high - shown.low < FLAT_M)
        return reaching


def _near(points: Points) -> Points:
    return chosen(points, np.flatnonzero(np.hypot(*points.T) < NEAR_M))


def _coincide(points: Points, others: Points) -> Flags:
    """Return which of `points` are at the same place as one of `others`."""
    if not len(others):
        return np.zeros(len(points), dtype=np.bool_)
    apart = np.hypot(*(points[:, None] - others[None]).T).T
    same: Flags = apart.min(axis=1) < SAME_M
    return same


def _without_edge(reaching: Points, edges: Points) -> Points:
    """Return the points of `reaching` that have no known edge between them and the robot."""
    far = np.maximum(np.hypot(*reaching.T), STEP_M)
    along = reaching @ edges.T / far[:, None]
    aside = np.abs(reaching[:, :1] * edges[:, 1] - reaching[:, 1:] * edges[:, 0]) / far[:, None]
    has_edge = (along > 0.0) & (along < far[:, None] + CELL_M) & (aside < ASIDE_M)
    return chosen(reaching, np.flatnonzero(~has_edge.any(axis=1)))


def _filled(reaching: Points, body: Footprint) -> tuple[Points, NDArray[np.intp]]:
    """Return the places on the lines from `reaching` to the hull, and for each place its row in `reaching`."""
    far = np.hypot(*reaching.T)
    steps = np.arange(CELL_M, NEAR_M, CELL_M)
    share = 1.0 - steps[:, None] / far
    x, y = (share * reaching[:, 0]).ravel(), (share * reaching[:, 1]).ravel()
    ahead = np.flatnonzero(share.ravel() > 0.0)
    places = chosen(from_columns(x, y), ahead)
    outside = np.flatnonzero(body.gaps(places) >= HULL_M)
    return chosen(places, outside), ahead[outside] % max(len(reaching), 1)
