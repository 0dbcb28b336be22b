"""When the hull first touches a point, if the twist stays as it is (docs/gate.md, 1).

A robot with a constant twist turns about the centre of rotation C = (-vy/w, vx/w); in its own base frame each point
of the world then runs on a circle about C, the other way round. `Line` and `Circles` hold these courses, seen along
the twist's first direction: x in this direction, y to the left, and so C = (0, v/w). The data of a
twist, a disc or an edge are plain numbers, those of points arrays (N,): calling numpy costs more than the
arithmetic does. Contact times are in seconds, infinity for never; they are those of points outside the hull.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.geometry.planar import Points, from_columns
from robots.bridge.gate.values import Velocity

Metres = NDArray[np.float64]
Growth = float | Metres  # how far the hull is grown, in metres: for all points, or for each (N,)
Rows = NDArray[np.intp]
Way = tuple[float, float]  # the direction in which a twist sets out: its cosine and sine in the base frame

STRAIGHT_ON: Way = (1.0, 0.0)
STRAIGHT_PER_M = 0.001  # |w| <= 0.001 |v| counts as straight: a turning circle of more than a kilometre
_HAIR_M = 1e-9  # added to both ends of an edge: between two nothing slips through


def speed(twist: Velocity) -> float:
    """Return how fast the base origin moves, m/s."""
    return math.hypot(twist.vx, twist.vy)


def is_straight(twist: Velocity) -> bool:
    """Return whether the turning is too little to tell the arc from a line."""
    return abs(twist.w) <= STRAIGHT_PER_M * speed(twist)


def centre(twist: Velocity) -> tuple[float, float]:
    """Centre of rotation C in the base frame, metres. Not for a straight twist."""
    return -twist.vy / twist.w, twist.vx / twist.w


def track(x: float, y: float, twist: Velocity) -> float:
    """The track of one point of the base frame: how far left of a straight way it is, or how far from C."""
    if is_straight(twist):
        return (twist.vx * y - twist.vy * x) / speed(twist)
    cx, cy = centre(twist)
    return math.hypot(x - cx, y - cy)


def way(twist: Velocity) -> Way:
    """Where the twist sets out to; straight on, if it turns on the spot."""
    v = speed(twist)
    return (twist.vx / v, twist.vy / v) if v > 0.0 else STRAIGHT_ON


def seen_along(points: Points, way: Way) -> Points:
    """Points of the base frame, with x along the way and y to the left of it."""
    if way == STRAIGHT_ON:
        return points
    (x, y), (cos, sin) = points.T, way
    return from_columns(cos * x + sin * y, cos * y - sin * x)


class Line(NamedTuple):
    """Points that run straight past the base: `x` ahead of it, `track` to the left."""

    v: float
    x: Metres
    track: Metres


class Circles(NamedTuple):
    """Points that run on circles about the C of several twists: arrays over twists are (twists, N).

    Each C is a distance `rho` to the left of the way (`sense` 1) or right (-1). Seen from there, `x` is ahead and
    `radial` in the base's direction; `track` is D, the distance. `turning` is |w|.
    """

    rho: list[float]
    sense: list[float]
    turning: list[float]
    x: Metres
    radial: Metres
    track: Metres


class Courses(NamedTuple):
    """How points run past the base for several twists, equally fast, that set out one way.

    `numbers`: of each twist its row in `circles`; -1 for straight ones, which all run along the one `line`. Twists are
    computed together, since calling numpy costs more than the arithmetic does.
    """

    way: Way
    v: float
    numbers: list[int]
    line: Line | None
    circles: Circles | None
    tracks: list[Metres]  # of each row in `circles`, then of the line

    def track(self, twist: int) -> Metres:
        """The tracks of all points for one of the twists."""
        return self.tracks[self.numbers[twist]]


class Contact(NamedTuple):
    """The first contact with any point: after how many seconds, less a reserve, and with which (its row)."""

    until_s: float
    row: int


NEVER = Contact(math.inf, -1)


def courses(points: Points, way: Way, twists: Sequence[Velocity]) -> Courses:
    """How points, seen along the way of the twists, run past the base."""
    x, y = points.T
    v = speed(twists[0])
    turns = [twist.w for twist in twists if abs(twist.w) > STRAIGHT_PER_M * v]
    line = Line(v, x, y) if len(turns) < len(twists) else None
    bent = iter(range(len(turns)))
    numbers = [next(bent) if abs(twist.w) > STRAIGHT_PER_M * v else -1 for twist in twists]
    circles = _circles(x, y, v, turns) if turns else None
    return Courses(way, v, numbers, line, circles, [*(circles.track if circles else ()), y])


def _circles(x: Metres, y: Metres, v: float, turns: list[float]) -> Circles:
    turning = [abs(w) for w in turns]
    rho, sense = [v / rate for rate in turning], [math.copysign(1.0, w) for w in turns]
    column = np.array((rho, sense))[..., None]
    radial = column[0] - column[1] * y
    return Circles(rho, sense, turning, x, radial, np.sqrt(x * x + radial * radial))


def _of(growth: Growth, rows: Rows) -> Growth:
    """The growth for some of the points."""
    return growth if isinstance(growth, float) else growth.take(rows)


def _first(rows: Rows, ways: Metres, rate: float) -> Contact:
    """The one that has the shortest way to go, in m or rad, at this rate."""
    if not len(rows):
        return NEVER
    first = int(ways.argmin())
    return Contact(float(ways[first]) / rate, int(rows[first]))


def _each(courses: Courses, straight: Contact, turning: list[Contact]) -> list[Contact]:
    """The contact of each twist."""
    return [turning[number] if number >= 0 else straight for number in courses.numbers]


def disc_contacts(courses: Courses, x: float, y: float, radius: Growth, reserve_m: float) -> list[Contact]:
    """Contact of each twist with a disc about (x, y), seen along the way. The reserve is left on the point's path."""
    line, circles = courses.line, courses.circles
    straight = _disc_straight(line, x, y, radius, reserve_m) if line else NEVER
    return _each(courses, straight, _disc_turning(circles, x, y, radius, reserve_m) if circles else [])


def _disc_straight(line: Line, x: float, y: float, radius: Growth, reserve_m: float) -> Contact:
    """t = (x - sqrt(r^2 - y^2)) / v, with x and y as the disc's middle sees them."""
    ahead, aside = line.x - x, np.abs(line.track - y)
    rows = ((aside < radius) & (ahead > 0.0)).nonzero()[0]
    if not len(rows):
        return NEVER
    half_chord = np.sqrt(_of(radius, rows) ** 2 - aside.take(rows) ** 2)
    return _first(rows, np.maximum(ahead.take(rows) - half_chord, 0.0) - reserve_m, line.v)


def _disc_turning(circles: Circles, x: float, y: float, radius: Growth, reserve_m: float) -> list[Contact]:
    """t = (phi - Delta) / |w|, Delta = arccos((D^2 + rho^2 - r^2) / (2 D rho)).

    rho and phi are those of the disc's middle.
    """
    middles = [rho - sense * y for rho, sense in zip(circles.rho, circles.sense, strict=True)]
    rhos = np.array([math.hypot(x, radial) for radial in middles])
    begins = np.array([math.atan2(x, radial) for radial in middles])
    hits = (np.abs(circles.track - rhos[:, None]) < radius).ravel().nonzero()[0]
    if not len(hits):
        return [NEVER] * len(middles)
    arcs = hits // len(circles.x)
    rows = hits - len(circles.x) * arcs
    d, r, rho = circles.track.take(hits), _of(radius, rows), rhos.take(arcs)
    phi = np.arctan2(circles.x.take(rows), circles.radial.take(hits)) - begins.take(arcs)
    phi += math.tau * (phi < 0.0)
    delta = np.arccos(np.minimum((d * d + (rho * rho - r * r)) / (2.0 * rho * d), 1.0))
    return _firsts(arcs, rows, np.maximum(phi - delta, 0.0) - reserve_m / d, circles.turning)


def _firsts(arcs: Rows, rows: Rows, ways: Metres, rates: list[float]) -> list[Contact]:
    """The first contact on each arc; `arcs` grow."""
    if len(rates) == 1:
        return [_first(rows, ways, rates[0])]
    ends = arcs.searchsorted(range(len(rates) + 1)).tolist()
    return [
        _first(rows[begin:end], ways[begin:end], rate)
        for begin, end, rate in zip(ends, ends[1:], rates, strict=False)
    ]


class Edges:
    """The edges of a convex polygon, counter-clockwise, ready to be grown outwards by a margin.

    Edge i lies where normal_i . p = offset_i; along it, u_i . p runs from one end to the other (u_i is the normal
    turned left). Growing by m moves each edge out by m and lengthens its ends by m times the tangent of half the
    bend there: corners stay sharp.
    """

    def __init__(self, outline: tuple[tuple[float, float], ...]) -> None:
        vertices = np.asarray(outline, dtype=np.float64)
        if (
            vertices.ndim != 2
            or vertices.shape[0] < 3
            or vertices.shape[1] != 2
            or not np.isfinite(vertices).all()
        ):
            raise ValueError("An outline needs three or more finite (x, y) corners.")
        sides = np.roll(vertices, -1, axis=0) - vertices
        lengths = np.hypot(sides[:, 0], sides[:, 1])
        if (lengths < 1e-6).any():
            raise ValueError("Two corners of the outline are in the same place.")
        along = sides / lengths[:, None]
        before = np.roll(along, 1, axis=0)
        bends = np.arctan2(
            before[:, 0] * along[:, 1] - before[:, 1] * along[:, 0], (before * along).sum(axis=1)
        )
        if (bends < -1e-9).any() or abs(bends.sum() - math.tau) > 1e-6:
            raise ValueError("The outline must be convex and run counter-clockwise.")
        self.vertices = vertices
        self.along = along
        self.normals = np.stack((along[:, 1], -along[:, 0]), axis=1)
        self.offsets = (self.normals * vertices).sum(axis=1)
        self.lengths = lengths
        low, low_stretch = (along * vertices).sum(axis=1), np.tan(bends / 2.0)
        self.ends = np.stack((low - _HAIR_M, low + lengths + _HAIR_M))
        self.stretch = np.stack((-low_stretch, np.roll(low_stretch, -1)))
        self.corner_stretch = 1.0 / np.cos(bends / 2.0)

    def gaps(self, points: Points) -> NDArray[np.float64]:
        """Return how far each point lies beyond the edge it is farthest beyond; negative inside.

        So the points with gap m are the outline grown by m.
        """
        gaps: NDArray[np.float64] = self.beyond(points).max(axis=0)
        return gaps

    def beyond(self, points: Points) -> NDArray[np.float64]:
        """Return how far each point lies beyond each edge's line, (edges, N).

        Written out, since BLAS might start threads, which cost more than this.
        """
        x, y = points.T
        (nx, ny), offsets = self.normals.T[..., None], self.offsets[:, None]
        distances: NDArray[np.float64] = nx * x + ny * y - offsets
        return distances


class _Side(NamedTuple):
    """An edge seen along a way: n . p = offset, and along it from `low` to `high`, which grow with the hull."""

    nx: float
    ny: float
    offset: float
    low: float
    high: float
    low_stretch: float
    high_stretch: float


@lru_cache(maxsize=8)  # a base that cannot move sideways has two ways
def _sides(edges: Edges, way: Way) -> tuple[_Side, ...]:
    columns = (*seen_along(edges.normals, way).T, edges.offsets, *edges.ends, *edges.stretch)
    sides = [_Side(*numbers) for numbers in np.array(columns).T.tolist()]
    return tuple(sorted(sides, reverse=True))  # what is in front meets the most


def polygon_contacts(courses: Courses, edges: Edges, growth: Growth, reserve_m: float) -> list[Contact]:
    """First contact of each twist with a convex polygon that is grown. The reserve is left along the point's path.

    A point comes in through an edge if its track lies between those of the edge's ends.
    """
    sides = [
        _Grown(
            side.nx,
            side.ny,
            side.offset + growth,
            side.low + growth * side.low_stretch,
            side.high + growth * side.high_stretch,
        )
        for side in _sides(edges, courses.way)
    ]
    line, circles = courses.line, courses.circles
    straight = min(_enter_straight(line, side, reserve_m) for side in sides) if line else NEVER
    return _each(courses, straight, _enter_turning(circles, sides, reserve_m) if circles else [])


class _Grown(NamedTuple):
    """A side of the grown hull; `height` is how far it lies out."""

    nx: float
    ny: float
    height: Growth
    low: Growth
    high: Growth


def _enter_straight(line: Line, side: _Grown, reserve_m: float) -> Contact:
    """When a point, moving along -v, first comes in through an edge."""
    if side.nx <= 0.0:
        return NEVER
    rightmost = side.ny * side.height + side.nx * side.low
    leftmost = side.ny * side.height + side.nx * side.high
    rows = ((line.track >= rightmost) & (line.track <= leftmost)).nonzero()[0]
    if not len(rows):
        return NEVER
    way = line.x.take(rows) - (_of(side.height, rows) - side.ny * line.track.take(rows)) / side.nx
    return _first(rows, np.where(way >= 0.0, way, np.inf) - reserve_m, line.v)


def _enter_turning(circles: Circles, sides: Sequence[_Grown], reserve_m: float) -> list[Contact]:
    """When a point, on its circle about C, first comes in through any edge.

    An edge's line is `height` away from C along its normal; the circle of radius D crosses it at angles of
    -+arccos(height / D) from the normal, and comes in at the minus sign, counted in the turning sense.
    """
    ways_in: list[tuple[int, float, Growth, Growth, Growth]] = []
    for arc, (rho, sense) in enumerate(zip(circles.rho, circles.sense, strict=True)):
        left = sense * rho  # of C
        for nx, ny, height, low, high in sides:
            height, low, high = height - ny * left, low - nx * left, high - nx * left
            begin, end = (-high, -low) if sense > 0.0 else (low, high)  # where points come in
            if not (isinstance(end, float) and end <= 0.0):
                facing = math.atan2(nx, -sense * ny)
                ways_in.append((arc, facing, height, _hypot(height, begin), _hypot(height, end)))
    if not ways_in:
        return [NEVER] * len(circles.rho)
    arcs, facings, heights, begins, ends = map(np.array, zip(*ways_in, strict=True))
    if heights.ndim == 1:
        heights, begins, ends = heights[:, None], begins[:, None], ends[:, None]
    tracks = circles.track.take(arcs, axis=0)
    hits = ((tracks > begins) & (tracks <= ends)).ravel().nonzero()[0]
    if not len(hits):
        return [NEVER] * len(circles.rho)
    points = len(circles.x)
    through = hits // points
    rows, arcs, d = hits - points * through, arcs.take(through), tracks.take(hits)
    height = heights.take(through) if heights.shape[1] == 1 else heights.take(hits)
    bearing = np.arctan2(circles.x.take(rows), circles.radial.take(points * arcs + rows))
    entry = facings.take(through) - np.arccos(height / d)
    return _firsts(arcs, rows, np.mod(bearing - entry, math.tau) - reserve_m / d, circles.turning)


def _hypot(height: Growth, along: Growth) -> Growth:
    """From C to where an edge's line is so far `along`, but no less than its height."""
    if isinstance(height, float) and isinstance(along, float):  # for two numbers numpy would be slow
        return math.hypot(height, max(along, 0.0))
    distances: Metres = np.hypot(height, np.maximum(along, 0.0))
    return distances
