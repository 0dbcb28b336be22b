"""From depth pictures to obstacle columns (docs/gate.md, 7 and 8).

First a picture is thinned: one measurement is kept for each square of pixels, without a copy of the message's
bytes. Clouds are converted to pictures, so that the later steps are the same for both. A camera's frame is
the optical frame: x right, y down, z ahead. Floor and ceiling are removed here, by the camera's pose alone.
The robot's own body and arm are removed later, in `obstacles/depth_camera.py`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.sensing.scan import Malformed
from robots.shared.geometry.planar import Points, from_columns
from robots.shared.sentences import say

Floats = NDArray[np.float32]
Levels = NDArray[np.uint16]
Transform = NDArray[np.float64]  # (4, 4), from the camera's frame to the base frame

COLUMNS = 160  # approximate number of pixel columns in a thinned picture
MOST_PIXELS = 4096  # along a side
LEAST_WIDE, LEAST_HIGH = 3, 2  # a place is checked in a pixel column and its two neighbours
NEAREST_M = 0.25
LEAST_AHEAD_M = 0.05  # points nearer to the camera are not in its picture
FARTHEST_M = 4.0  # twice the stopping distance from 1 m/s; beyond, tilt errors turn the floor into obstacles
FLOOR_M = 0.05  # lower points count as floor; the laser sees most of them
TILT_ERROR = 0.01  # metres of height for each metre of distance: half a degree
NOISE_PER_M = 0.0015  # sigma of a structured-light camera, by the square of the distance
NOISE_SIGMAS = 1.5  # of the height error from noise along the ray: smaller heights count as floor
ABOVE_CAMERA_M = 0.08  # the head's top and a margin: the robot passes below higher things
CELL_M = 0.05
HITS = 3  # in one cell; fewer are noise
LEAST_SHOWN_SHARE = 0.3  # of the floor within reach; of shiny and dark floors only parts are measured
LEAST_FLOOR_SHARE = 0.05  # of a picture; with less floor within reach a picture is not checked
BEHIND_M = 0.10  # a ray that was measured this far behind a place passed through the place
FLOOR_BEHIND_M = 0.03  # the same for the floor, which is close behind low things
WIDEST_SHARE = 0.4  # cosine of the largest sideways angle in the picture of a lowered camera
HEIGHTS = 6  # number of heights at which a column's place is checked for free space
LEVEL_M = 0.1  # height of a level; a column seen at every level is one thing, present or gone as a whole
TALL_M = 0.25  # shorter columns have no inner part
END_M = 0.08  # ends of a thing that are not its inner part: noise may have made it longer

PATCH_ROWS = 8  # of a thinned picture: as high as a shallow table far away

_HALF = math.ceil((FARTHEST_M + 1.0) / CELL_M)  # cells from the base to the edge of the counting grid
_SIDE = 2 * _HALF


class Lens(NamedTuple):
    """A pinhole camera: focal lengths and middle in pixels."""

    fx: float
    fy: float
    cx: float
    cy: float

    @property
    def makes_sense(self) -> bool:
        """Return whether a camera can have this lens: an uncalibrated camera reports zeros."""
        return all(map(math.isfinite, self)) and self.fx > 0.0 and self.fy > 0.0

    @classmethod
    def seeing(cls, fov: float, width: int, height: int) -> Lens:
        """Return a lens with this horizontal field of view (radians) and its axis in the picture's middle."""
        focal = width / 2.0 / math.tan(fov / 2.0)
        return cls(focal, focal, width / 2.0, height / 2.0)


class DepthImage(NamedTuple):
    """A received depth image: `encoding` 32FC1 (metres) or 16UC1 (millimetres), rows `step` bytes apart."""

    width: int
    height: int
    encoding: str
    big_endian: bool
    step: int
    data: bytes | memoryview


class Cloud(NamedTuple):
    """A received point cloud; `offsets`: bytes to the 32-bit floats x, y, z within a point."""

    width: int
    height: int
    point_step: int
    row_step: int
    offsets: Mapping[str, int]
    big_endian: bool
    data: bytes | memoryview


class Picture(NamedTuple):
    """Distances along the optical axis (rows, columns), metres. NaN: unknown; infinity: nothing within reach.

    `right` and `down`: the directions of columns and rows, in metres to the right and down for each metre
    ahead.
    """

    ahead: Floats
    right: Floats
    down: Floats


class Columns(NamedTuple):
    """Obstacles: places in the base frame, with the lowest and highest height seen there (metres).

    Bit n of `levels` is set if something was seen between n and n + 1 times `LEVEL_M`; None: unknown.
    """

    points: Points
    low: Floats
    high: Floats
    levels: Levels | None = None

    def only(self, kept: NDArray[np.bool_] | NDArray[np.intp]) -> Columns:
        """Return some of the columns."""
        levels = None if self.levels is None else self.levels[kept]
        return Columns(self.points.T[:, kept].T, self.low[kept], self.high[kept], levels)


# --- messages -> pictures --------------------------------------------------------------------------


def picture_of_image(image: DepthImage, lens: Lens) -> Picture:
    """Return a thinned depth image. Raises Malformed."""
    kinds = {"32FC1": "f4", "16UC1": "u2"}
    if image.encoding not in kinds:
        text = say(
            "its pictures are {encoding}, only 32FC1 and 16UC1 are understood",
            encoding=repr(image.encoding[:20]),
        )
        raise Malformed(text)
    _check_size(image.width, image.height)
    if not lens.makes_sense:
        raise Malformed(say("its camera calibration is not valid"))
    kind = np.dtype((">" if image.big_endian else "<") + kinds[image.encoding])
    if image.step < image.width * kind.itemsize:
        raise Malformed(say("the rows of its pictures are too short"))
    if (image.height - 1) * image.step + image.width * kind.itemsize > len(image.data):
        raise Malformed(say("its pictures are shorter than their headers state"))
    thin = _thinning(image.width, image.height)
    rows, columns = image.height // thin, image.width // thin
    first = thin // 2  # the middle of each square represents it
    start = first * (image.step + kind.itemsize)
    strides = (thin * image.step, thin * kind.itemsize)
    pixels = _view(image.data, (rows, columns), kind, start, strides)
    ahead = pixels.astype(np.float32)
    if kind.kind == "u":
        ahead *= np.float32(0.001)
    ahead[~(ahead > 0.0)] = np.nan
    across = first + thin * np.arange(columns)
    along = first + thin * np.arange(rows)
    return Picture(ahead, _parts(across, lens.cx, lens.fx), _parts(along, lens.cy, lens.fy))


def picture_of_cloud(cloud: Cloud, fov: float) -> Picture:
    """Return a cloud as a picture of a camera at its origin, with the nearest points. Raises Malformed."""
    x, y, z = _coordinates(cloud)
    columns, rows = COLUMNS, COLUMNS * 3 // 4
    lens = Lens.seeing(fov, columns, rows)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        across = np.floor(x / z * np.float32(lens.fx) + np.float32(lens.cx))
        along = np.floor(y / z * np.float32(lens.fy) + np.float32(lens.cy))
        kept = (z > 0.0) & (across >= 0) & (across < columns) & (along >= 0) & (along < rows)
    ahead = np.full(rows * columns, np.inf, dtype=np.float32)
    np.minimum.at(ahead, (along[kept] * columns + across[kept]).astype(np.intp), z[kept])
    ahead[np.isinf(ahead)] = np.nan  # a pixel without a point is not known to be free
    right, down = (
        _parts(np.arange(n) + 0.5, c, f)
        for n, c, f in ((columns, lens.cx, lens.fx), (rows, lens.cy, lens.fy))
    )
    return Picture(ahead.reshape(rows, columns), right, down)


def _coordinates(cloud: Cloud) -> tuple[Floats, Floats, Floats]:
    """Return x, y, z of a thinned cloud, flat."""
    if cloud.width < 1 or cloud.height < 1 or cloud.width * cloud.height > MOST_PIXELS**2:
        raise Malformed(say("its clouds have no points, or far too many"))
    if not all(0 <= cloud.offsets.get(axis, -1) <= cloud.point_step - 4 for axis in "xyz"):
        raise Malformed(say("its clouds have no x, y and z"))
    if cloud.row_step < cloud.width * cloud.point_step:
        raise Malformed(say("the rows of its clouds are too short"))
    if cloud.height > 1:
        thin = thin_rows = _thinning(cloud.width, cloud.height)
    else:
        thin, thin_rows = max(cloud.width // (COLUMNS * COLUMNS), 1), 1
    shape = (math.ceil(cloud.height / thin_rows), math.ceil(cloud.width / thin))
    strides = (thin_rows * cloud.row_step, thin * cloud.point_step)
    kind = np.dtype(">f4" if cloud.big_endian else "<f4")
    x, y, z = (
        _view(cloud.data, shape, kind, cloud.offsets[axis], strides).astype(np.float32).ravel()
        for axis in "xyz"
    )
    return x, y, z


def _view(
    data: bytes | memoryview,
    shape: tuple[int, int],
    kind: np.dtype[np.generic],
    start: int,
    strides: tuple[int, int],
) -> NDArray[np.generic]:
    last = start + (shape[0] - 1) * strides[0] + (shape[1] - 1) * strides[1] + kind.itemsize
    if last > len(data):
        raise Malformed(say("its pictures are shorter than their headers state"))
    view: NDArray[np.generic] = np.ndarray(shape, kind, data, start, strides)
    return view


def _check_size(width: int, height: int) -> None:
    if not (LEAST_WIDE <= width <= MOST_PIXELS and LEAST_HIGH <= height <= MOST_PIXELS):
        raise Malformed(say("its pictures have {width} x {height} pixels", width=width, height=height))


def _thinning(width: int, height: int) -> int:
    """Return the side of the squares of which one pixel is kept; at least two squares fit in each direction."""
    return max(min(width // COLUMNS, height // 2), 1)


def _parts(pixels: NDArray[Any], centre: float, focal: float) -> Floats:
    parts: Floats = ((pixels - centre) / focal).astype(np.float32)
    return parts


# --- pictures -> obstacles -------------------------------------------------------------------------


def top_m(to_base: Transform, height_m: float) -> float:
    """Return the robot's top in metres: at least `height_m`; the head rises with its camera."""
    return max(height_m, float(to_base[2, 3]) + ABOVE_CAMERA_M)


def check_shown(picture: Picture, to_base: Transform) -> None:
    """Raise Malformed if the picture shows neither the floor within reach nor anything in front of it.

    Otherwise a covered lens, a picture of NaN, or a wrong camera pose would count as a free way.
    """
    per_metre = _rise(picture, to_base)
    floor, expected = _floor(*_looks(picture, to_base))
    with np.errstate(invalid="ignore", over="ignore"):
        depth_below = -(picture.ahead * per_metre + np.float32(to_base[2, 3]))
        shown = floor & (picture.ahead > NEAREST_M) & (depth_below < _floor_error(picture.ahead))
    if expected > LEAST_FLOOR_SHARE * floor.size and np.count_nonzero(shown) < LEAST_SHOWN_SHARE * expected:
        raise Malformed(say("its pictures show neither the floor nor objects on it"))


def columns_of(picture: Picture, to_base: Transform, highest_m: float) -> Columns:
    """Return the points between floor and robot height, in cells of 5 cm with at least three hits."""
    ahead = picture.ahead
    turned = to_base.astype(np.float32)
    with np.errstate(invalid="ignore", over="ignore"):
        height = ahead * _rise(picture, to_base) + turned[2, 3]
        hit = (
            (height > _floor_error(ahead)) & (height < highest_m) & (ahead > NEAREST_M) & (ahead < FARTHEST_M)
        )
    hits = np.flatnonzero(hit)
    rows, columns = np.divmod(hits, ahead.shape[1])
    far, right, down = ahead.ravel()[hits], picture.right[columns], picture.down[rows]
    x = far * (turned[0, 0] * right + turned[0, 1] * down + turned[0, 2]) + turned[0, 3]
    y = far * (turned[1, 0] * right + turned[1, 1] * down + turned[1, 2]) + turned[1, 3]
    return _counted(x, y, height.ravel()[hits])


def _rise(picture: Picture, to_base: Transform) -> Floats:
    """Return by how much each pixel's ray rises per metre ahead."""
    return _rises(*_looks(picture, to_base))


# Facts of the camera's pose and lens alone are computed once while the head rests: the last two cameras' are kept.


def _looks(picture: Picture, to_base: Transform) -> tuple[bytes, bytes, bytes]:
    """Return directions of the pixels, and height and tilt of the camera, as bytes."""
    return picture.right.tobytes(), picture.down.tobytes(), to_base[2].tobytes()


@lru_cache(2)
def _rises(right: bytes, down: bytes, upright: bytes) -> Floats:
    """Return `_rise`. Do not change it."""
    up = np.frombuffer(upright).astype(np.float32)
    across, along = np.frombuffer(right, np.float32), np.frombuffer(down, np.float32)
    rise: Floats = up[0] * across + (up[1] * along + up[2])[:, None]
    return rise


@lru_cache(2)
def _floor(right: bytes, down: bytes, upright: bytes) -> tuple[NDArray[np.bool_], int]:
    """Return the pixels that would show an empty floor within reach, and their number."""
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        to_floor = -float(np.frombuffer(upright)[3]) / _rises(right, down, upright)
        floor = (to_floor > NEAREST_M) & (to_floor < FARTHEST_M)
    return floor, int(np.count_nonzero(floor))


@lru_cache(2)
def _passes_m(right: bytes, down: bytes, upright: bytes, height_m: float) -> Floats:
    """Return how far (m along the floor) each patch of rays is where its nearest ray passes a height."""
    rise = _rises(right, down, upright)
    across, along = np.frombuffer(right, np.float32), np.frombuffer(down, np.float32)
    level = np.sqrt(across**2 + (along**2)[:, None] + 1.0 - rise**2)
    with np.errstate(divide="ignore"):
        passes_m = np.where(rise < 0.0, (height_m - np.frombuffer(upright)[3]) / rise * level, np.inf)
    rows = min(PATCH_ROWS, len(passes_m))
    begins_m: Floats = np.minimum(passes_m[: len(passes_m) - rows + 1], passes_m[rows - 1 :])
    return begins_m


def _floor_error(ahead: Floats) -> Floats:
    """Return the largest apparent height of the floor at these distances, metres."""
    return (ahead * (TILT_ERROR + NOISE_SIGMAS * NOISE_PER_M * ahead) + FLOOR_M).astype(
        np.float32, copy=False
    )


def _counted(x: Floats, y: Floats, height: Floats) -> Columns:
    """Return a column at the mean place of the hits in each cell with enough hits, without inner cells."""
    near = np.maximum(np.abs(x), np.abs(y)) < _HALF * CELL_M
    x, y, height = x[near], y[near], height[near]
    cells = _cell(x) * _SIDE + _cell(y)
    counts = np.bincount(cells, minlength=_SIDE * _SIDE)
    many = _rim(counts >= HITS)
    low = np.full(len(counts), np.inf, dtype=np.float32)
    high = np.full(len(counts), -np.inf, dtype=np.float32)
    np.minimum.at(low, cells, height)
    np.maximum.at(high, cells, height)
    levels = np.zeros(len(counts), dtype=np.uint16)
    np.bitwise_or.at(levels, cells, _level(height))
    middle_x = np.bincount(cells, x, len(counts))[many] / counts[many]
    middle_y = np.bincount(cells, y, len(counts))[many] / counts[many]
    return Columns(from_columns(middle_x, middle_y), low[many], high[many], levels[many])


def _level(height: Floats) -> Levels:
    number = np.clip(height * np.float32(1.0 / LEVEL_M), 0.0, 15.0).astype(np.uint16)
    level: Levels = np.left_shift(np.uint16(1), number)
    return level


def is_one_thing(columns: Columns, gaps: bool = False) -> NDArray[np.bool_]:
    """Return which columns are tall, and something was seen at each level between their ends.

    With `gaps`, two levels in a row may be missing.
    """
    if columns.levels is None:
        return np.zeros(len(columns.points), dtype=np.bool_)
    lowest, highest = _level(columns.low), _level(columns.high)
    between: Levels = (highest - lowest) | highest  # all levels from the lowest to the highest
    tall = columns.high - columns.low > TALL_M
    seen: Levels = columns.levels
    if gaps:
        seen = seen | np.left_shift(seen, np.uint16(1)) | np.right_shift(seen, np.uint16(1))
    one: NDArray[np.bool_] = tall & (seen & between == between)
    return one


def _cell(along: Floats) -> NDArray[np.intp]:
    cells: NDArray[np.intp] = np.floor(along * np.float32(1.0 / CELL_M)).astype(np.intp) + _HALF
    return cells


def _rim(occupied: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the occupied cells with a free neighbour: a robot reaches a table top's inside over its edge."""
    grid = occupied.reshape(_SIDE, _SIDE)
    inside = np.zeros_like(grid)
    inside[1:-1, 1:-1] = grid[:-2, 1:-1] & grid[2:, 1:-1] & grid[1:-1, :-2] & grid[1:-1, 2:]
    return np.flatnonzero(grid & ~inside)


# --- evidence of free space ------------------------------------------------------------------------


def measured_to_m(picture: Picture, to_base: Transform, height_m: float) -> Floats:
    """Return how far each column of pixels is measured without a hole: m along the floor from the lens.

    A hole is a patch of rows of which less than `LEAST_SHOWN_SHARE` is measured. It begins where its nearest ray
    passes `height_m`: something black or glossy may be there. Infinite: there is no hole.
    """
    begins_m = _passes_m(*_looks(picture, to_base), height_m)
    rows = min(PATCH_ROWS, len(picture.ahead))
    measured = np.zeros((len(picture.ahead) + 1, picture.ahead.shape[1]), dtype=np.int16)
    np.cumsum(~np.isnan(picture.ahead), axis=0, out=measured[1:])
    holes = measured[rows:] - measured[:-rows] < LEAST_SHOWN_SHARE * rows
    to_m: Floats = np.where(holes, begins_m, np.inf).min(axis=0).astype(np.float32)
    return to_m


class _Evidence(NamedTuple):
    """Evidence of a picture about columns.

    `through`: at which of the `heights` the picture sees through them. `denied`: at one height something is
    there.
    """

    heights: Floats  # (HEIGHTS, columns)
    through: NDArray[np.bool_]
    denied: NDArray[np.bool_]  # (columns)


def came_since(picture: Picture, to_base: Transform, columns: Columns) -> NDArray[np.bool_]:
    """Return which columns (base frame of the picture) came later: this earlier picture saw through them."""
    evidence = _evidence(picture, to_base, columns)
    came: NDArray[np.bool_] = ~evidence.denied & evidence.through.any(axis=0)
    return came


def seen_through(picture: Picture, to_base: Transform, columns: Columns) -> NDArray[np.bool_]:
    """Return which columns (base frame) are gone: at their place the picture shows the floor or a point behind.

    For one tall thing a free height between its ends is enough; otherwise each height must be free. If
    something is still measured at any height, the column is not gone. Heights out of view, unmeasured or
    hidden give no evidence.
    """
    gone = np.zeros(len(columns.points), dtype=np.bool_)
    before = np.flatnonzero(_may_be_in_view(to_base, columns.points))
    columns = columns.only(before)
    evidence = _evidence(picture, to_base, columns)
    inner = (evidence.heights > columns.low + END_M) & (evidence.heights < columns.high - END_M)
    part, whole = (evidence.through & inner).any(axis=0), evidence.through.all(axis=0)
    gone[before] = ~evidence.denied & np.where(is_one_thing(columns), part, whole)
    return gone


def _may_be_in_view(to_base: Transform, points: Points) -> NDArray[np.bool_]:
    """Return which points may be in view. Quick: excludes most points next to and behind the camera."""
    x, y = points[:, 0] - to_base[0, 3], points[:, 1] - to_base[1, 3]
    level = math.hypot(to_base[0, 2], to_base[1, 2])
    ahead = to_base[0, 2] * x + to_base[1, 2] * y
    may: NDArray[np.bool_] = ahead > level * (WIDEST_SHARE * np.sqrt(x * x + y * y) - NEAREST_M)
    return may


def _evidence(picture: Picture, to_base: Transform, columns: Columns) -> _Evidence:
    share = np.linspace(0.0, 1.0, HEIGHTS, dtype=np.float32)[:, None]
    height = columns.low + share * (columns.high - columns.low)
    x, y = columns.points.T
    inverse = np.linalg.inv(to_base).astype(np.float32)
    x, y = x.astype(np.float32), y.astype(np.float32)
    right, down, ahead = (
        inverse[i, 0] * x + inverse[i, 1] * y + inverse[i, 2] * height + inverse[i, 3] for i in range(3)
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        column = _pixel(picture.right, right / ahead)
        row = _pixel(picture.down, down / ahead)
    rows, wide = picture.ahead.shape
    in_view = (ahead > LEAST_AHEAD_M) & (row >= 0) & (row < rows) & (column >= 1) & (column < wide - 1)
    upright = np.where(in_view, row, 1).astype(np.intp)
    beside = np.where(in_view, column, 1).astype(np.intp) + np.array([-1, 0, 1])[:, None, None]
    measured = picture.ahead[upright, beside]
    up = to_base[2].astype(np.float32)
    rise = up[0] * picture.right[beside] + (up[1] * picture.down[upright] + up[2])
    noise = 4.0 * NOISE_PER_M * ahead**2
    with np.errstate(invalid="ignore"):
        shows_floor = measured * rise + up[3] < _floor_error(measured)
        behind = measured - (ahead + noise)
        free = behind > np.where(shows_floor, FLOOR_BEHIND_M, BEHIND_M)
        met = ~free & ~shows_floor & (behind > -BEHIND_M - 2.0 * noise)
    through = in_view & free.all(axis=0)
    denied = (in_view & met.any(axis=0)).any(axis=0)
    return _Evidence(height, through, denied)


def _pixel(looks: Floats, part: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the number of the evenly spaced row or column in direction `part`."""
    pixels: NDArray[np.float64] = np.rint((part - looks[0]) / (looks[1] - looks[0]))
    return pixels
