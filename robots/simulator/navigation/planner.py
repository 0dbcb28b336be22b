"""Global plan: the cheapest path on the map. It keeps away from walls where there is room."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from robots.simulator.sensors.survey import FREE, OCCUPIED, RESOLUTION_M, Survey

Point = tuple[float, float]
Cell = tuple[int, int]  # row, column

STEP_CELLS = 2  # the path runs on every second cell of the map: 0.1 m
WALL_INFLUENCE_M = 0.7  # walls within this distance make a path more expensive
DEARER = 4.0  # additional cost of a metre at a wall; a metre in the open costs 1
BESIDE_M = 0.3  # a goal in an obstacle is moved by at most this along each axis

_NEIGHBOURS = [(row, column) for row in (-1, 0, 1) for column in (-1, 0, 1) if row or column]


class CostMap:
    """Distances (m) to the nearest obstacle of the map or of the laser, up to `WALL_INFLUENCE_M`."""

    def __init__(self, survey: Survey, radius_m: float) -> None:
        self._survey = survey
        self._radius_m = radius_m
        self._known = survey.cells == FREE
        self._clear = _clearance(survey.cells == OCCUPIED)
        self._mapped = self._clear

    def mark(self, points: Iterable[Point]) -> None:
        """Add obstacles (world) to the map's; they replace the obstacles that were added before."""
        solid = np.zeros(self._known.shape, bool)
        for point in points:
            row, column = self.cell(point)
            if 0 <= row < solid.shape[0] and 0 <= column < solid.shape[1]:
                solid[row, column] = True
        self._clear = np.minimum(self._mapped, _clearance(solid))

    def clear_m(self, point: Point) -> float:
        """Return the distance (m) from a point to the nearest obstacle; 0 outside the known map."""
        return self._clear_at(self.cell(point))

    def cell(self, point: Point) -> Cell:
        """Return the cell of a point."""
        survey = self._survey
        return (
            math.floor((point[1] - survey.south_m) / RESOLUTION_M),
            math.floor((point[0] - survey.west_m) / RESOLUTION_M),
        )

    def plan(self, start: Point, goal: Point) -> list[Point]:
        """Return points from `start` to `goal`; empty without a path. It may start too close to a wall."""
        begin, end = self._coarse(start), self._nearest_open(self._coarse(goal))
        if end is None:
            return []
        cells = self._search(begin, end)
        if not cells:
            return []
        points = [self._point(cell) for cell in cells]
        points[0] = start
        if self._open(self._coarse(goal)):
            points[-1] = goal
        return points

    def _search(self, begin: Cell, end: Cell) -> list[Cell]:
        """Search by A*, with the straight distance as the estimate."""
        came: dict[Cell, Cell] = {}
        cost = {begin: 0.0}
        queue = [(math.dist(begin, end), begin)]
        done: set[Cell] = set()
        while queue:
            _, cell = heapq.heappop(queue)
            if cell == end:
                return list(_back(came, cell))[::-1]
            if cell in done:
                continue
            done.add(cell)
            for row, column in _NEIGHBOURS:
                other = cell[0] + row, cell[1] + column
                clear_m = self._clear_at((other[0] * STEP_CELLS, other[1] * STEP_CELLS))
                if clear_m < self._radius_m and math.dist(other, begin) > self._radius_m / RESOLUTION_M:
                    continue
                if clear_m <= 0.0:
                    continue
                dear = 1.0 + DEARER * max(0.0, WALL_INFLUENCE_M - clear_m) / WALL_INFLUENCE_M
                via = cost[cell] + math.hypot(row, column) * dear
                if via < cost.get(other, math.inf):
                    cost[other] = via
                    came[other] = cell
                    heapq.heappush(queue, (via + math.dist(other, end), other))
        return []

    def _coarse(self, point: Point) -> Cell:
        row, column = self.cell(point)
        return row // STEP_CELLS, column // STEP_CELLS

    def _point(self, cell: Cell) -> Point:
        half = STEP_CELLS / 2
        return (
            self._survey.west_m + (cell[1] * STEP_CELLS + half) * RESOLUTION_M,
            self._survey.south_m + (cell[0] * STEP_CELLS + half) * RESOLUTION_M,
        )

    def _open(self, cell: Cell) -> bool:
        return self._clear_at((cell[0] * STEP_CELLS, cell[1] * STEP_CELLS)) >= self._radius_m

    def _nearest_open(self, goal: Cell) -> Cell | None:
        reach = round(BESIDE_M / RESOLUTION_M / STEP_CELLS)
        around = [
            (goal[0] + row, goal[1] + column)
            for row in range(-reach, reach + 1)
            for column in range(-reach, reach + 1)
        ]
        return min(filter(self._open, around), key=lambda cell: math.dist(cell, goal), default=None)

    def _clear_at(self, cell: Cell) -> float:
        rows, columns = self._known.shape
        if not (0 <= cell[0] < rows and 0 <= cell[1] < columns) or not self._known[cell]:
            return 0.0
        return float(self._clear[cell])


def _clearance(solid: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the distance (m) of each cell to the nearest solid cell, up to `WALL_INFLUENCE_M`."""
    reach = round(WALL_INFLUENCE_M / RESOLUTION_M)
    clear = np.full(solid.shape, WALL_INFLUENCE_M)
    rows, columns = np.nonzero(solid)
    for row in range(-reach, reach + 1):
        for column in range(-reach, reach + 1):
            distance = math.hypot(row, column) * RESOLUTION_M
            if distance >= WALL_INFLUENCE_M:
                continue
            r, c = rows + row, columns + column
            inside = (r >= 0) & (r < solid.shape[0]) & (c >= 0) & (c < solid.shape[1])
            r, c = r[inside], c[inside]
            clear[r, c] = np.minimum(clear[r, c], distance)
    return clear


def _back(came: dict[Cell, Cell], cell: Cell) -> Iterator[Cell]:
    yield cell
    while cell in came:
        cell = came[cell]
        yield cell
