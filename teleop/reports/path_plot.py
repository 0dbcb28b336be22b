"""The paths of drives as a picture: lines in colours of speed on the robot's map and a grid of metres, x to the right
and y up.

Pure: poses in, numbers for an SVG out. Poses are [x, y, yaw] in metres and radians, samples [t_s, x, y, yaw, speed].
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import groupby, pairwise

from msgspec import Struct

WIDTH, HEIGHT = 800, 600  # of the picture, in units of its own
MARGIN = 40  # units around what is drawn
SMALLEST_M = 2.0  # wide: a robot that hardly moved is not shown as under a microscope
AROUND_M = 3.0  # of a map, about the path: enough to know the room
MOST_LINES = 14  # of the grid, across
STEPS_M = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
SPEEDS_MPS = (0.1, 0.2, 0.4, 0.7)  # where one colour ends and the next begins

Numbers = Sequence[float]


class Leg(Struct, frozen=True):
    """One drive. `frame` is where its odometry frame lies in the map's, if that is known."""

    begins_s: float  # on the clock of the picture
    samples: Sequence[Numbers]
    frame: Numbers | None = None


class Ground(Struct, frozen=True):
    """What is drawn beneath: the picture of a map, which lies as nav_msgs/OccupancyGrid says."""

    number: int  # of the picture
    wide_m: float
    high_m: float
    origin: Numbers  # its lower left corner in the map's frame

    @property
    def corners(self) -> list[tuple[float, float, float]]:
        """In the map's frame."""
        across, up = (0.0, self.wide_m), (0.0, self.high_m)
        return [_placed((x, y, 0.0), self.origin) for x in across for y in up]


class Line(Struct, frozen=True):
    """A stretch of one colour; `points` as an SVG takes them."""

    pace: int  # 0: the slowest of `len(SPEEDS_MPS) + 1`
    points: str


class Plot(Struct, frozen=True):
    """What is drawn, in units of the picture."""

    lines: list[Line]
    marks: list[tuple[float, float]]  # where the gate held back
    across: list[float]  # lines of the grid: y of each
    upright: list[float]  # x of each
    step_m: float  # between two of them
    on_map: bool  # whether places are the map's
    ground: Ground | None
    lay: str  # the transform that lays the ground, in metres from its upper left corner, onto the picture
    replay: list[list[list[float]]]  # of each drive its samples: s, x, y, degrees clockwise from the right


class _Scale(Struct, frozen=True):
    """From metres to units."""

    left: float  # metres, of the picture's edges
    top: float
    per_m: float

    def __call__(self, x: float, y: float) -> tuple[float, float]:
        return round((x - self.left) * self.per_m, 1), round((self.top - y) * self.per_m, 1)


def plotted(
    legs: Sequence[Leg], marks: Sequence[tuple[Numbers, Numbers | None]], ground: Ground | None = None
) -> Plot | None:
    """The drives, and the poses where the gate held back, each with its frame; None if nothing is known of any path."""
    legs = [leg for leg in legs if leg.samples]
    if not legs:
        return None
    on_map = all(leg.frame for leg in legs)
    paths = [[_placed(sample[1:4], leg.frame if on_map else None) for sample in leg.samples] for leg in legs]
    held = [
        _placed(pose, frame if on_map else None) for pose, frame in marks if frame is not None or not on_map
    ]
    ground = ground if on_map else None
    shown = [pose for path in paths for pose in path] + held
    scale = _fitting(shown + _surroundings(shown, ground))
    step_m = next((step for step in STEPS_M if WIDTH / scale.per_m / step <= MOST_LINES), STEPS_M[-1])
    return Plot(
        lines=[line for leg, path in zip(legs, paths, strict=True) for line in _lines(leg, path, scale)],
        marks=[scale(x, y) for x, y, _yaw in held],
        across=_grid(scale.top * scale.per_m, step_m * scale.per_m, HEIGHT),
        upright=_grid(-scale.left * scale.per_m, step_m * scale.per_m, WIDTH),
        step_m=step_m,
        on_map=on_map,
        ground=ground,
        lay=_lay(ground, scale) if ground else "",
        replay=[
            [
                [round(leg.begins_s + sample[0], 2), *scale(x, y), round(-math.degrees(yaw), 1)]
                for sample, (x, y, yaw) in zip(leg.samples, path, strict=True)
            ]
            for leg, path in zip(legs, paths, strict=True)
        ],
    )


def pace_of(speed_mps: float) -> int:
    """Which colour a speed has."""
    return sum(speed_mps > limit for limit in SPEEDS_MPS)


def _placed(pose: Numbers, frame: Numbers | None) -> tuple[float, float, float]:
    """A pose of a frame, in the frame that that one lies in."""
    x, y, yaw = pose
    if frame is None:
        return x, y, yaw
    left, up, turn = frame
    c, s = math.cos(turn), math.sin(turn)
    return left + c * x - s * y, up + s * x + c * y, yaw + turn


def _surroundings(poses: Sequence[Numbers], ground: Ground | None) -> list[Numbers]:
    """How far the ground reaches about these poses, but not more than `AROUND_M`."""
    if ground is None:
        return []
    (west, east), (south, north) = _reach(poses, 0), _reach(poses, 1)
    return [
        [min(max(x, west - AROUND_M), east + AROUND_M), min(max(y, south - AROUND_M), north + AROUND_M)]
        for x, y, _yaw in ground.corners
    ]


def _reach(poses: Sequence[Numbers], axis: int) -> tuple[float, float]:
    along = [pose[axis] for pose in poses]
    return min(along), max(along)


def _lay(ground: Ground, scale: _Scale) -> str:
    """As SVG takes it."""
    turn = ground.origin[2]
    c, s = scale.per_m * math.cos(turn), scale.per_m * math.sin(turn)
    x, y, _yaw = _placed((0.0, ground.high_m, 0.0), ground.origin)
    left, down = (x - scale.left) * scale.per_m, (scale.top - y) * scale.per_m
    return f"matrix({c:.6g} {-s:.6g} {s:.6g} {c:.6g} {left:.6g} {down:.6g})"


def _fitting(poses: Sequence[Numbers]) -> _Scale:
    """All of them in the picture, in its middle."""
    (west, east), (south, north) = _reach(poses, 0), _reach(poses, 1)
    wide, high = max(east - west, SMALLEST_M), max(north - south, SMALLEST_M)
    per_m = min((WIDTH - 2 * MARGIN) / wide, (HEIGHT - 2 * MARGIN) / high)
    left = (west + east) / 2 - WIDTH / per_m / 2
    top = (south + north) / 2 + HEIGHT / per_m / 2
    return _Scale(left, top, per_m)


def _lines(leg: Leg, path: Sequence[Numbers], scale: _Scale) -> Iterator[Line]:
    """Neighbours of one colour are one line, so that it bends smoothly."""
    steps = [
        (pace_of(math.dist(here[:2], there[:2]) / max(later[0] - sooner[0], 1e-3)), here, there)
        for (sooner, here), (later, there) in pairwise(zip(leg.samples, path, strict=True))
    ]
    for pace, of_pace in groupby(steps, key=lambda step: step[0]):
        together = list(of_pace)
        poses = [together[0][1], *(there for _pace, _here, there in together)]
        yield Line(pace, " ".join("{},{}".format(*scale(x, y)) for x, y, _yaw in poses))


def _grid(zero: float, step: float, size: int) -> list[float]:
    """Lines so far apart, one of them at `zero`, over the picture and as much on either side: it may have more room."""
    first, last = math.ceil((-size - zero) / step), math.floor((2 * size - zero) / step)
    return [round(zero + number * step, 1) for number in range(first, last + 1)]
