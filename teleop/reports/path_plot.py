"""The paths of drives as a picture: lines coloured by speed, on the robot's map and a grid in metres; x right, y up.

Pure functions from poses to numbers for an SVG. Poses are [x, y, yaw] in metres and radians, samples are
[t_s, x, y, yaw, speed].
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import groupby, pairwise

from msgspec import Struct

WIDTH, HEIGHT = 800, 600  # of the picture, in SVG units
MARGIN = 40  # units around the drawing
SMALLEST_M = 2.0  # smallest width shown, so that a tiny movement is not magnified
AROUND_M = 3.0  # shown of the map around the path: enough to recognise the room
MOST_LINES = 14  # grid lines across the picture
STEPS_M = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
SPEEDS_MPS = (0.1, 0.2, 0.4, 0.7)  # limits between two colours

Numbers = Sequence[float]


class DrivePath(Struct, frozen=True):
    """The path of one drive. `frame`: the pose of its odometry frame in the map's frame, if known."""

    begins_s: float  # since the start of the control session
    samples: Sequence[Numbers]
    frame: Numbers | None = None


class MapImage(Struct, frozen=True):
    """The picture of a map, placed as in nav_msgs/OccupancyGrid."""

    number: int  # of the picture
    wide_m: float
    high_m: float
    origin: Numbers  # its lower left corner in the map's frame

    @property
    def corners(self) -> list[tuple[float, float, float]]:
        """Its corners in the map's frame."""
        across, up = (0.0, self.wide_m), (0.0, self.high_m)
        return [_transformed((x, y, 0.0), self.origin) for x in across for y in up]


class Line(Struct, frozen=True):
    """A line of one colour; `points` in SVG notation."""

    pace: int  # speed class; 0: the slowest of `len(SPEEDS_MPS) + 1`
    points: str


class Plot(Struct, frozen=True):
    """The drawing, in SVG units."""

    lines: list[Line]
    marks: list[tuple[float, float]]  # where the gate intervened
    grid_y: list[float]  # y of each horizontal grid line
    grid_x: list[float]  # x of each vertical grid line
    step_m: float  # between two grid lines
    on_map: bool  # whether coordinates are the map's (else the odometry's)
    map_image: MapImage | None
    map_transform: str  # SVG transform of the map picture, given in metres from its upper left corner
    replay: list[list[list[float]]]  # samples of each drive: s, x, y, degrees clockwise from the right


class _Scale(Struct, frozen=True):
    """Converts metres to SVG units."""

    left: float  # left edge of the picture in metres
    top: float
    per_m: float

    def __call__(self, x: float, y: float) -> tuple[float, float]:
        return round((x - self.left) * self.per_m, 1), round((self.top - y) * self.per_m, 1)


def plot_drives(
    drives: Sequence[DrivePath],
    marks: Sequence[tuple[Numbers, Numbers | None]],
    map_image: MapImage | None = None,
) -> Plot | None:
    """Draw drives and `marks`: poses where the gate intervened, each with its frame.

    Return None without any path.
    """
    drives = [drive for drive in drives if drive.samples]
    if not drives:
        return None
    on_map = all(drive.frame for drive in drives)
    paths = [
        [_transformed(sample[1:4], drive.frame if on_map else None) for sample in drive.samples]
        for drive in drives
    ]
    held = [
        _transformed(pose, frame if on_map else None)
        for pose, frame in marks
        if frame is not None or not on_map
    ]
    map_image = map_image if on_map else None
    shown = [pose for path in paths for pose in path] + held
    scale = _fit_scale(shown + _surroundings(shown, map_image))
    step_m = next((step for step in STEPS_M if WIDTH / scale.per_m / step <= MOST_LINES), STEPS_M[-1])
    return Plot(
        lines=[
            line for drive, path in zip(drives, paths, strict=True) for line in _lines(drive, path, scale)
        ],
        marks=[scale(x, y) for x, y, _yaw in held],
        grid_y=_grid(scale.top * scale.per_m, step_m * scale.per_m, HEIGHT),
        grid_x=_grid(-scale.left * scale.per_m, step_m * scale.per_m, WIDTH),
        step_m=step_m,
        on_map=on_map,
        map_image=map_image,
        map_transform=_map_transform(map_image, scale) if map_image else "",
        replay=[
            [
                [round(drive.begins_s + sample[0], 2), *scale(x, y), round(-math.degrees(yaw), 1)]
                for sample, (x, y, yaw) in zip(drive.samples, path, strict=True)
            ]
            for drive, path in zip(drives, paths, strict=True)
        ],
    )


def pace_of(speed_mps: float) -> int:
    """Return the speed class of a speed: 0 is the slowest."""
    return sum(speed_mps > limit for limit in SPEEDS_MPS)


def _transformed(pose: Numbers, frame: Numbers | None) -> tuple[float, float, float]:
    """Transform a pose from `frame` to that frame's parent."""
    x, y, yaw = pose
    if frame is None:
        return x, y, yaw
    left, up, turn = frame
    c, s = math.cos(turn), math.sin(turn)
    return left + c * x - s * y, up + s * x + c * y, yaw + turn


def _surroundings(poses: Sequence[Numbers], map_image: MapImage | None) -> list[Numbers]:
    """Return the map's corners, limited to `AROUND_M` around these poses."""
    if map_image is None:
        return []
    (west, east), (south, north) = _reach(poses, 0), _reach(poses, 1)
    return [
        [min(max(x, west - AROUND_M), east + AROUND_M), min(max(y, south - AROUND_M), north + AROUND_M)]
        for x, y, _yaw in map_image.corners
    ]


def _reach(poses: Sequence[Numbers], axis: int) -> tuple[float, float]:
    along = [pose[axis] for pose in poses]
    return min(along), max(along)


def _map_transform(map_image: MapImage, scale: _Scale) -> str:
    """Return the SVG transform of the map picture."""
    turn = map_image.origin[2]
    c, s = scale.per_m * math.cos(turn), scale.per_m * math.sin(turn)
    x, y, _yaw = _transformed((0.0, map_image.high_m, 0.0), map_image.origin)
    left, down = (x - scale.left) * scale.per_m, (scale.top - y) * scale.per_m
    return f"matrix({c:.6g} {-s:.6g} {s:.6g} {c:.6g} {left:.6g} {down:.6g})"


def _fit_scale(poses: Sequence[Numbers]) -> _Scale:
    """Return the scale that shows all poses in the middle of the picture."""
    (west, east), (south, north) = _reach(poses, 0), _reach(poses, 1)
    wide, high = max(east - west, SMALLEST_M), max(north - south, SMALLEST_M)
    per_m = min((WIDTH - 2 * MARGIN) / wide, (HEIGHT - 2 * MARGIN) / high)
    left = (west + east) / 2 - WIDTH / per_m / 2
    top = (south + north) / 2 + HEIGHT / per_m / 2
    return _Scale(left, top, per_m)


def _lines(drive: DrivePath, path: Sequence[Numbers], scale: _Scale) -> Iterator[Line]:
    """Join neighbouring steps of the same colour into one line, so that it bends smoothly."""
    steps = [
        (pace_of(math.dist(here[:2], there[:2]) / max(later[0] - sooner[0], 1e-3)), here, there)
        for (sooner, here), (later, there) in pairwise(zip(drive.samples, path, strict=True))
    ]
    for pace, of_pace in groupby(steps, key=lambda step: step[0]):
        together = list(of_pace)
        poses = [together[0][1], *(there for _pace, _here, there in together)]
        yield Line(pace, " ".join("{},{}".format(*scale(x, y)) for x, y, _yaw in poses))


def _grid(zero: float, step: float, size: int) -> list[float]:
    """Return grid lines, one of them at `zero`, over three picture sizes: the page may show more than the picture."""
    first, last = math.ceil((-size - zero) / step), math.floor((2 * size - zero) / step)
    return [round(zero + number * step, 1) for number in range(first, last + 1)]
