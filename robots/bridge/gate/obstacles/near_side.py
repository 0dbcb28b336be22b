"""The range that a depth camera cannot measure is unseen, not free.

A camera such as the Xtion measures nothing within half a metre. Of a table at which the robot was parked it shows the
far part only, and the edge that would be met first is in no picture. So whatever reaches into that range is taken to
reach on to the robot, unless its near edge was seen before, from farther away. It stays so while the thing itself is
remembered and out of the picture: also when the robot turns round, or the pictures end.
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
    seen_from,
)
from robots.bridge.gate.obstacles.point_memory import DEPTH_LAYER, Memory
from robots.bridge.gate.sensing.depth import CELL_M, Columns, Transform
from robots.bridge.gate.values import Pose

Flags = NDArray[np.bool_]

STEP_M = 2.0 * CELL_M  # a place so much nearer would show whether something ends
FLAT_M = 0.10  # what is higher from top to bottom is a face, and its near side is what was measured
ASIDE_M = 1.5 * CELL_M  # an edge so far beside the line to the robot is the same thing's
SAME_M = 0.06  # between an edge and where it is remembered
HULL_M = 0.02  # nearer to the hull nothing is assumed: it would have been touched
NEAR_M = 1.5  # of the base: farther than any blind range reaches


class NearSide:
    """The near edges that one camera has seen, and what may hide before those that it has not."""

    def __init__(self, blind_m: float) -> None:
        """`blind_m`: along the camera's axis; nothing nearer is measured."""
        self._blind_m = blind_m
        self._edges = Memory(DEPTH_LAYER)
        self._tops = self._places = NO_POINTS  # what hides, and where something may be; odometry frame
        self._top_of: NDArray[np.intp] = np.empty(0, dtype=np.intp)  # of each place, its row in `_tops`

    def clear(self) -> None:
        """Forget the edges, and what is hidden."""
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
        """Where something may be that the camera at `to_base` cannot measure, odometry frame.

        `shown` is its picture (base frame) from `base`, `remembered` (odometry frame) what stands of earlier ones.
        """
        cut = self._is_cut(shown, to_base)
        places = placed(shown.points, base)
        self._edges.see(chosen(places, np.flatnonzero(~cut)), base, now_s)
        self._forget(places, remembered, base, body)
        if cut.any():
            there = seen_from(ORIGIN, base)
            edges = _near(placed(self._edges.points(now_s), there))
            edges = edges[_beside(edges, _near(placed(remembered, there)))]
            self._add(_unvouched(shown.points[cut], edges), base, body)
        return self._places

    def _forget(self, shown: Points, remembered: Points, base: Pose, body: Footprint) -> None:
        """Tops in the picture are judged anew; those that are gone hide nothing, nor does any where the robot is."""
        if not len(self._tops):
            return
        self._keep(_beside(self._tops, remembered) & ~_beside(self._tops, shown))
        outside = np.flatnonzero(body.gaps(placed(self._places, seen_from(ORIGIN, base))) >= 0.0)
        self._places, self._top_of = chosen(self._places, outside), self._top_of[outside]

    def _keep(self, tops: Flags) -> None:
        """Only these tops, and what they hide."""
        places = np.flatnonzero(tops[self._top_of])
        self._places = chosen(self._places, places)
        self._top_of = (np.cumsum(tops) - 1)[self._top_of[places]]
        self._tops = chosen(self._tops, np.flatnonzero(tops))

    def _add(self, tops: Points, base: Pose, body: Footprint) -> None:
        """These tops (base frame) may reach on to the robot."""
        places, top_of = _filled(tops, body)
        self._places = np.concatenate((self._places, placed(places, base)))
        self._top_of = np.concatenate((self._top_of, len(self._tops) + top_of))
        self._tops = np.concatenate((self._tops, placed(tops, base)))

    def _is_cut(self, shown: Columns, to_base: Transform) -> Flags:
        """Which tops may go on nearer: what is a little nearer, at their own height, cannot be measured."""
        x, y = shown.points.T
        far = np.maximum(np.hypot(x, y), STEP_M)
        x, y = x - STEP_M * x / far, y - STEP_M * y / far
        inverse = np.linalg.inv(to_base)[2]
        ahead = inverse[0] * x + inverse[1] * y + inverse[2] * shown.high + inverse[3]
        cut: Flags = (ahead < self._blind_m) & (shown.high - shown.low < FLAT_M)
        return cut


def _near(points: Points) -> Points:
    return chosen(points, np.flatnonzero(np.hypot(*points.T) < NEAR_M))


def _beside(points: Points, others: Points) -> Flags:
    """Which of `points` have one of `others` at the same place."""
    if not len(others):
        return np.zeros(len(points), dtype=np.bool_)
    apart = np.hypot(*(points[:, None] - others[None]).T).T
    same: Flags = apart.min(axis=1) < SAME_M
    return same


def _unvouched(cut: Points, edges: Points) -> Points:
    """Those of `cut` between which and the robot no edge is known."""
    far = np.maximum(np.hypot(*cut.T), STEP_M)
    along = cut @ edges.T / far[:, None]
    aside = np.abs(cut[:, :1] * edges[:, 1] - cut[:, 1:] * edges[:, 0]) / far[:, None]
    vouched = (along > 0.0) & (along < far[:, None] + CELL_M) & (aside < ASIDE_M)
    return chosen(cut, np.flatnonzero(~vouched.any(axis=1)))


def _filled(cut: Points, body: Footprint) -> tuple[Points, NDArray[np.intp]]:
    """Places from there to the hull, and to which of `cut` each belongs."""
    far = np.hypot(*cut.T)
    steps = np.arange(CELL_M, NEAR_M, CELL_M)
    share = 1.0 - steps[:, None] / far
    x, y = (share * cut[:, 0]).ravel(), (share * cut[:, 1]).ravel()
    ahead = np.flatnonzero(share.ravel() > 0.0)
    places = chosen(from_columns(x, y), ahead)
    outside = np.flatnonzero(body.gaps(places) >= HULL_M)
    return chosen(places, outside), ahead[outside] % max(len(cut), 1)
