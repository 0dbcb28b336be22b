"""The map that SLAM would make of the world with the robot's laser: walls in its plane, and free space."""

from __future__ import annotations

import math
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from robots.simulator.physics.mujoco_world import Physics
from robots.simulator.physics.scene import OBJECT_GROUP

RESOLUTION_M = 0.05
# Slightly less than half: a box that ends at a cell's edge must not occupy the next cell.
HALF_CELL_M = 0.499 * RESOLUTION_M
UNKNOWN, FREE, OCCUPIED = -1, 0, 100  # percent, as in nav_msgs/OccupancyGrid

Cells = NDArray[np.int8]  # row 0 is the south edge


class Survey(NamedTuple):
    """Cells, and the world's coordinates of their lower left corner."""

    cells: Cells
    west_m: float
    south_m: float


def surveyed(
    physics: Physics, size: tuple[float, float, float, float], height_m: float, up_to_m: float | None = None
) -> Survey:
    """Return the map of `size` (west, south, east, north) that a laser at this height makes from reachable cells.

    With `up_to_m`: with all obstacles between these two heights.
    """
    west, south, east, north = size
    columns = west + RESOLUTION_M * (np.arange(math.ceil((east - west) / RESOLUTION_M)) + 0.5)
    rows = south + RESOLUTION_M * (np.arange(math.ceil((north - south) / RESOLUTION_M)) + 0.5)
    x, y = np.meshgrid(columns, rows)
    solid = np.zeros(x.shape, bool)
    for geom in _standing(physics, height_m, height_m if up_to_m is None else up_to_m):
        solid |= _covers(physics, geom, x, y)
    at = physics.pose
    start = np.argmin(np.abs(rows - at.y)), np.argmin(np.abs(columns - at.x))
    free = _reached(~solid, (int(start[0]), int(start[1])))
    cells = np.full(x.shape, UNKNOWN, np.int8)
    cells[free] = FREE
    cells[solid & _grown(free)] = OCCUPIED  # only visible sides are occupied
    return Survey(cells, west, south)


def _standing(physics: Physics, from_m: float, to_m: float) -> list[int]:
    """Return the fixed boxes between these heights: walls and furniture, no people."""
    model, heights = physics.model, physics.data.geom_xpos[:, 2]
    still = (model.geom_group == OBJECT_GROUP) & (model.body_mocapid[model.geom_bodyid] < 0)
    half = model.geom_size[:, 2]
    met = (heights - half <= to_m) & (heights + half >= from_m)
    return np.flatnonzero(still & met & (model.geom_type == mujoco.mjtGeom.mjGEOM_BOX)).tolist()


def _covers(physics: Physics, geom: int, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return the cells that an upright box covers in part, even a box as thin as a chair's leg."""
    from_x, from_y, _ = physics.data.geom_xpos[geom]
    axis_x, _, _, axis_y, *_ = physics.data.geom_xmat[geom]
    half_x, half_y, _ = physics.model.geom_size[geom] + HALF_CELL_M
    along = axis_x * (x - from_x) + axis_y * (y - from_y)
    across = axis_x * (y - from_y) - axis_y * (x - from_x)
    covered: NDArray[np.bool_] = (np.abs(along) < half_x) & (np.abs(across) < half_y)
    return covered


def _reached(open_cells: NDArray[np.bool_], start: tuple[int, int]) -> NDArray[np.bool_]:
    """Return the open cells that are connected to the one at `start`."""
    reached = np.zeros_like(open_cells)
    reached[start] = True
    count = 0
    while count < (count := int(reached.sum())):
        reached = _grown(reached) & open_cells
    return reached


def _grown(cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return these cells and their neighbours."""
    padded = np.pad(cells, 1)
    rows = padded[:-2] | padded[1:-1] | padded[2:]
    grown: NDArray[np.bool_] = rows[:, :-2] | rows[:, 1:-1] | rows[:, 2:]
    return grown
