"""The robot's map, used to check whether the robot can stand at a goal."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robots.shared.geometry.footprint import Footprint
from robots.shared.geometry.planar import ORIGIN, Points, from_columns, placed, relative_to
from robots.shared.geometry.poses import Pose
from robots.shared.maps.occupancy import OCCUPIED, UNKNOWN, cells_of
from robots.shared.records.record_sink import TakenMap
from robots.shared.wire import Refusal

AROUND_M = 2.0  # occupied cells within this distance of the goal are checked: no footprint reaches farther

NO_MAP = Refusal(
    "no_map", "The robot’s map has not come yet: nobody can be sent to a place without it.", "robot"
)
UNKNOWN_NOW = Refusal(
    "map_unknown",
    "The robot or its map server was restarted, and its present map has not been read since: ask again soon.",
    "robot",
)
OUTSIDE = Refusal("goal_outside", "This place is outside the known part of the robot’s map.", "robot")
IN_OBSTACLE = Refusal(
    "goal_in_obstacle", "The robot has no room at this place: its map has an obstacle there.", "robot"
)


class GoalMap:
    """One map. To create it takes up to 10 ms (the picture is unpacked); to check a goal is fast."""

    def __init__(self, taken: TakenMap) -> None:
        self.digest = taken.digest
        self._origin, self._resolution_m = taken.origin, taken.resolution_m
        self._cells: NDArray[np.uint8] = cells_of(taken)  # row 0 is the lower edge

    def refuse(self, goal: Pose, footprint: Footprint) -> Refusal | None:
        """Return why the robot cannot stand at `goal`; None if it can."""
        here = relative_to(goal, self._origin)
        column, row = int(here.x // self._resolution_m), int(here.y // self._resolution_m)
        height, width = self._cells.shape
        if not (0 <= column < width and 0 <= row < height) or self._cells[row, column] == UNKNOWN:
            return OUTSIDE
        around = self._occupied(column, row)
        if not len(around):
            return None
        at_goal = placed(placed(around, self._origin), relative_to(ORIGIN, goal))
        return IN_OBSTACLE if (footprint.gaps(at_goal) < 0.0).any() else None

    def _occupied(self, column: int, row: int) -> Points:
        """Return the centres of occupied cells around a cell, in the frame of the map's corner."""
        reach = round(AROUND_M / self._resolution_m) + 1
        left, bottom = max(column - reach, 0), max(row - reach, 0)
        part = self._cells[bottom : row + reach + 1, left : column + reach + 1]
        rows, columns = np.nonzero(part == OCCUPIED)
        return from_columns(
            np.asarray((columns + left + 0.5) * self._resolution_m, np.float64),
            np.asarray((rows + bottom + 0.5) * self._resolution_m, np.float64),
        )
