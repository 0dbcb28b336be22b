"""Places in a depth camera's blind range count as unseen, not as free.

A camera such as the Xtion measures nothing within half a metre: its blind range. If the robot was parked at
a table, the camera shows only the far part of the table; no picture shows its near edge.

If an obstacle reaches the edge of the blind range, the gate assumes that it goes on to the robot. The gate
does not assume this if an earlier picture showed the near edge of the obstacle. The assumption lasts while the
obstacle is remembered and out of the picture, also when the robot turns or the pictures end.

A *flat point* is a column of the picture that may be a part of such an obstacle: flat, and next to the blind
range. A *hidden place* is a place between a flat point and the robot that may be occupied.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.obstacles.point_memory import DEPTH_LAYER, Memory
from robots.bridge.gate.sensing.depth import CELL_M, Columns, Transform
from robots.shared.geometry.footprint import Footprint
from robots.shared.geometry.planar import NO_POINTS, ORIGIN, Points, chosen, from_columns, placed, relative_to
from robots.shared.geometry.poses import Pose

Flags = NDArray[np.bool_]

# One step nearer to the robot; if the camera can measure there, it shows the obstacle's end
STEP_M = 2.0 * CELL_M
FLAT_M = 0.10  # a taller column is a vertical face: its near side was measured
ASIDE_M = 1.5 * CELL_M  # an edge this near to the line from a flat point to the robot is of the same obstacle
SAME_M = 0.06  # largest distance between an edge and its remembered place
HULL_M = 0.02  # places nearer to the hull than this are free: an obstacle there would touch the robot
NEAR_M = 1.5  # largest distance of edges and hidden places from the base: more than any blind range


class NearSide:
    """Near edges that one camera has seen, and places that may be an obstacle's unseen near side."""

    def __init__(self, blind_m: float) -> None:
        """`blind_m`: distance along the camera's axis; the camera measures nothing nearer."""
        self._blind_m = blind_m
        self._edges = Memory(DEPTH_LAYER)
        self._flat_points = NO_POINTS  # odometry frame
        self._places = NO_POINTS  # the hidden places, odometry frame
        self._flat_rows: NDArray[np.intp] = np.empty(0, dtype=np.intp)  # for each place, its flat point

    def clear(self) -> None:
        """Forget edges and hidden places."""
        self._edges.clear()
        self._keep(np.zeros(len(self._flat_points), dtype=np.bool_))

    def hidden(
        self,
        shown: Columns,
        to_base: Transform,
        base: Pose,
        remembered: Points,
        body: Footprint,
        now_s: float,
    ) -> Points:
        """Return the hidden places in the blind range of the camera, odometry frame.

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
        """Drop flat points that are in the picture (and checked again) or gone, and places inside the robot."""
        if not len(self._flat_points):
            return
        self._keep(_coincide(self._flat_points, remembered) & ~_coincide(self._flat_points, shown))
        outside = np.flatnonzero(body.gaps(placed(self._places, relative_to(ORIGIN, base))) >= 0.0)
        self._places, self._flat_rows = chosen(self._places, outside), self._flat_rows[outside]

    def _keep(self, kept: Flags) -> None:
        """Keep only these flat points and their hidden places."""
        places = np.flatnonzero(kept[self._flat_rows])
        self._places = chosen(self._places, places)
        self._flat_rows = (np.cumsum(kept) - 1)[self._flat_rows[places]]
        self._flat_points = chosen(self._flat_points, np.flatnonzero(kept))

    def _add(self, flat_points: Points, base: Pose, body: Footprint) -> None:
        """Add flat points (base frame) of obstacles that may go on to the robot, and their hidden places."""
        places, rows = _filled(flat_points, body)
        self._places = np.concatenate((self._places, placed(places, base)))
        self._flat_rows = np.concatenate((self._flat_rows, len(self._flat_points) + rows))
        self._flat_points = np.concatenate((self._flat_points, placed(flat_points, base)))

    def _reaches_blind_range(self, shown: Columns, to_base: Transform) -> Flags:
        """Return which columns are flat, and may go on towards the robot, where the camera is blind."""
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


def _without_edge(flat_points: Points, edges: Points) -> Points:
    """Return the flat points without a known edge between them and the robot."""
    far = np.maximum(np.hypot(*flat_points.T), STEP_M)
    along = flat_points @ edges.T / far[:, None]
    aside = np.abs(flat_points[:, :1] * edges[:, 1] - flat_points[:, 1:] * edges[:, 0]) / far[:, None]
    has_edge = (along > 0.0) & (along < far[:, None] + CELL_M) & (aside < ASIDE_M)
    return chosen(flat_points, np.flatnonzero(~has_edge.any(axis=1)))


def _filled(flat_points: Points, body: Footprint) -> tuple[Points, NDArray[np.intp]]:
    """Return the places on the lines from the flat points to the hull, and the row of the flat point of each."""
    far = np.hypot(*flat_points.T)
    steps = np.arange(CELL_M, NEAR_M, CELL_M)
    share = 1.0 - steps[:, None] / far
    x, y = (share * flat_points[:, 0]).ravel(), (share * flat_points[:, 1]).ravel()
    ahead = np.flatnonzero(share.ravel() > 0.0)
    places = chosen(from_columns(x, y), ahead)
    outside = np.flatnonzero(body.gaps(places) >= HULL_M)
    return chosen(places, outside), ahead[outside] % max(len(flat_points), 1)
