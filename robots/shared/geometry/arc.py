"""Compute the time until the hull first touches a point, if the twist stays constant (docs/gate.md, 1).

A robot with a constant twist turns about the centre of rotation C = (-vy/w, vx/w). In its base frame each
point of the world then moves on a circle about C in the opposite sense: the course of the point. `Line` and
`Circle` hold these courses. They are "seen along" the direction in which the twist begins: in coordinates with x
in this direction and y to the left, so C = (0, v/w).

Data of a twist, a disc or an edge are plain numbers, data of points are arrays (N,): a call of numpy costs more
than the arithmetic. Contact times are in seconds; infinity means never. They are valid for points outside the
hull.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from itertools import chain
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.shared.geometry.planar import Points, from_columns
from robots.shared.geometry.poses import Velocity

Metres = NDArray[np.float64]
OneOrEach = float | Metres  # one number for all points, or one for each (N,)
Rows = NDArray[np.intp]  # numbers of points in an array
Direction = tuple[float, float]  # of a twist at its start: cosine and sine in the base frame

STRAIGHT_ON: Direction = (1.0, 0.0)
STRAIGHT_PER_M = 0.001  # |w| <= 0.001 |v| counts as straight: a turning circle of more than a kilometre
_HAIR_M = 1e-9  # added to both ends of an edge, so that no point passes between two edges


def speed(twist: Velocity) -> float:
    """Return how fast the base origin moves, m/s."""
    return math.hypot(twist.vx, twist.vy)


def is_straight(twist: Velocity) -> bool:
    """Return whether the twist turns so little that its arc counts as a line."""
    return abs(twist.w) <= STRAIGHT_PER_M * speed(twist)


def centre(twist: Velocity) -> tuple[float, float]:
    """Return the centre of rotation C in the base frame, metres. Not for a straight twist."""
    return -twist.vy / twist.w, twist.vx / twist.w


def track(x: float, y: float, twist: Velocity) -> float:
    """Return the track of a point (base frame): its distance to the left of a straight path, or from C."""
    if is_straight(twist):
        return (twist.vx * y - twist.vy * x) / speed(twist)
    cx, cy = centre(twist)
    return math.hypot(x - cx, y - cy)


def direction_of(twist: Velocity) -> Direction:
    """Return the direction of the twist at its start; straight ahead for a turn on the spot."""
    v = speed(twist)
    return (twist.vx / v, twist.vy / v) if v > 0.0 else STRAIGHT_ON


def seen_along(points: Points, direction: Direction) -> Points:
    """Return points of the base frame in coordinates with x along this direction and y to the left of it."""
    if direction == STRAIGHT_ON:
        return points
    (x, y), (cos, sin) = points.T, direction
    return from_columns(cos * x + sin * y, cos * y - sin * x)


class Line(NamedTuple):
    """Points that move straight past the base: `x` ahead of it, `track` to the left."""

    v: float
    x: Metres
    track: Metres


class Circle(NamedTuple):
    """Points that move on circles about the C of one twist.

    C is at the distance `rho` to the left (`sense` 1) or right (-1) of the base. From C, `x` is the coordinate
    along the direction, and `radial` the coordinate towards the base. `squares` are D^2, the squared distances
    from C.
    `turning` is |w|.
    """

    rho: float
    sense: float
    turning: float
    x: Metres
    radial: Metres
    squares: Metres


class Courses(NamedTuple):
    """Courses of points past the base for several twists with the same speed and direction.

    `circles`: one for each twist; None for straight twists, which all share the one `line`.
    """

    direction: Direction
    v: float
    line: Line
    circles: list[Circle | None]

    def track(self, twist: int, rows: Rows) -> Metres:
        """Return the tracks of some of the points for one of the twists."""
        circle = self.circles[twist]
        return self.line.track.take(rows) if circle is None else np.sqrt(circle.squares.take(rows))


class Contact(NamedTuple):
    """The first contact with any point: seconds until then, minus a reserve, and the row of the point."""

    until_s: float
    row: int


NEVER = Contact(math.inf, -1)


def courses(points: Points, direction: Direction, twists: Sequence[Velocity]) -> Courses:
    """Return the courses of points past the base. The points are seen along the direction of the twists."""
    x, y = points.T
    v = speed(twists[0])
    circles: list[Circle | None] = []
    ahead: Metres | None = None
    for _, _, w in twists:
        turning = abs(w)
        if turning <= STRAIGHT_PER_M * v:
            circles.append(None)
            continue
        if ahead is None:
            ahead = x * x
        rho, sense = v / turning, math.copysign(1.0, w)
        radial = rho - y if sense > 0.0 else rho + y
        squares = radial * radial
        squares += ahead
        circles.append(Circle(rho, sense, turning, x, radial, squares))
    return Courses(direction, v, Line(v, x, y), circles)


def _of(numbers: OneOrEach, rows: Rows) -> OneOrEach:
    """Return the numbers of some of the points."""
    return numbers if isinstance(numbers, float) else numbers.take(rows)


def _first(rows: Rows, distances: Metres, rate: float) -> Contact:
    """Return the contact after the shortest distance (m or rad), at this rate."""
    if not len(rows):
        return NEVER
    first = int(distances.argmin())
    return Contact(float(distances[first]) / rate, int(rows[first]))


def disc_contacts(courses: Courses, x: float, y: float, radius: OneOrEach, reserve_m: float) -> list[Contact]:
    """Return each twist's first contact of a disc about (x, y), seen along the direction, with a point.

    The reserve is left on the point's path.
    """
    straight = _disc_straight(courses.line, x, y, radius, reserve_m) if None in courses.circles else NEVER
    return [
        straight if circle is None else _disc_turning(circle, x, y, radius, reserve_m)
        for circle in courses.circles
    ]


def _disc_straight(line: Line, x: float, y: float, radius: OneOrEach, reserve_m: float) -> Contact:
    """t = (x - sqrt(r^2 - y^2)) / v, with x and y relative to the disc's middle."""
    ahead, aside = line.x - x, np.abs(line.track - y)
    rows = ((aside < radius) & (ahead > 0.0)).nonzero()[0]
    if not len(rows):
        return NEVER
    half_chord = np.sqrt(_of(radius, rows) ** 2 - aside.take(rows) ** 2)
    return _first(rows, np.maximum(ahead.take(rows) - half_chord, 0.0) - reserve_m, line.v)


def _disc_turning(circle: Circle, x: float, y: float, radius: OneOrEach, reserve_m: float) -> Contact:
    """t = (phi - Delta) / |w|, Delta = arccos((D^2 + rho^2 - r^2) / (2 D rho)).

    rho and phi are those of the disc's middle.
    """
    middle = circle.rho - circle.sense * y
    rho = math.hypot(x, middle)
    near = rho - radius
    inner = max(near, 0.0) if isinstance(near, float) else np.maximum(near, 0.0)
    rows = ((circle.squares < (rho + radius) ** 2) & (circle.squares > inner * inner)).nonzero()[0]
    if not len(rows):
        return NEVER
    r, squares = _of(radius, rows), circle.squares.take(rows)
    d = np.sqrt(squares)
    phi = np.arctan2(circle.x.take(rows), circle.radial.take(rows))
    if x:
        phi -= math.atan2(x, middle)
    phi += math.tau * (phi < 0.0)
    cosines = squares + (rho * rho - r * r)
    cosines /= 2.0 * rho * d
    phi -= np.arccos(np.minimum(cosines, 1.0))
    angles = np.maximum(phi, 0.0)
    return _first(rows, angles - reserve_m / d if reserve_m else angles, circle.turning)


def disc_meets_s(x: float, y: float, twist: Velocity, radius_m: float, reserve_m: float) -> float:
    """Return the time until a twist that turns brings a disc about the origin to a point.

    The point is seen along the twist's direction. The reserve, on the base's path, is subtracted. Same as
    `disc_contacts`, in plain numbers. Infinity: never, or the twist is straight or a turn on the spot.
    """
    v, turning = speed(twist), abs(twist.w)
    if v == 0.0 or turning <= STRAIGHT_PER_M * v:
        return math.inf
    rho = v / turning
    radial = rho - y if twist.w > 0.0 else rho + y
    squares = radial * radial + x * x
    if not max(rho - radius_m, 0.0) ** 2 < squares < (rho + radius_m) ** 2:
        return math.inf
    # Nearly straight, the cosine is nearly 1 and its last bit counts: the operations have the same order as there.
    cosine = (squares + (rho * rho - radius_m * radius_m)) / (2.0 * rho * math.sqrt(squares))
    onward = math.atan2(x, radial) % math.tau - math.acos(min(cosine, 1.0))
    return max(onward, 0.0) / turning - reserve_m / v


class Edges:
    """The edges of a convex polygon, counter-clockwise, ready to be grown outwards by a margin.

    Edge i is the part of the line normal_i . p = offset_i on which u_i . p is between two ends (u_i is the
    normal turned left). Growing by m moves each edge out by m, and moves each end by m times the tangent of
    half the bend there: corners remain sharp.
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
        self.normals = np.array((along[:, 1], -along[:, 0])).T.copy()
        self.offsets = (self.normals * vertices).sum(axis=1)
        self.lengths = lengths
        low, low_stretch = (along * vertices).sum(axis=1), np.tan(bends / 2.0)
        self.ends = np.stack((low - _HAIR_M, low + lengths + _HAIR_M))
        self.stretch = np.stack((-low_stretch, np.roll(low_stretch, -1)))
        self.corner_stretch = 1.0 / np.cos(bends / 2.0)

    def gaps(self, points: Points) -> NDArray[np.float64]:
        """Return the largest of each point's distances beyond the edges' lines; negative inside.

        So the points with gap m form the outline grown by m.
        """
        beyond = self.normals @ points.T
        beyond -= self.offsets[:, None]
        gaps: NDArray[np.float64] = np.maximum.reduce(beyond)
        return gaps


class _Side(NamedTuple):
    """An edge seen along a direction: n . p = offset, between the ends `low` and `high`. It grows with the hull.

    `facing_left` and `facing_right`: the angle of n, seen from a C on the left or on the right.
    """

    nx: float
    ny: float
    offset: float
    low: float
    high: float
    low_stretch: float
    high_stretch: float
    facing_left: float
    facing_right: float


@lru_cache(maxsize=8)  # a base that cannot move sideways has two directions
def _sides(edges: Edges, direction: Direction) -> tuple[_Side, ...]:
    nx, ny = seen_along(edges.normals, direction).T
    facing = np.arctan2(nx, -ny), np.arctan2(nx, ny)
    columns = (nx, ny, edges.offsets, *edges.ends, *edges.stretch, *facing)
    sides = [_Side(*numbers) for numbers in np.array(columns).T.tolist()]
    return tuple(sorted(sides, reverse=True))  # front edges first: most points enter there


def polygon_contacts(
    courses: Courses, edges: Edges, hull_growth: OneOrEach, reserve_m: float
) -> list[Contact]:
    """Return each twist's first contact of a grown convex polygon with a point.

    The reserve is left along the point's path. A point enters through an edge if its track lies between the
    tracks of the edge's ends.
    """
    straight = NEVER
    if None in courses.circles:
        sides = _sides(edges, courses.direction)
        straight = min(_enter_straight(courses.line, side, hull_growth, reserve_m) for side in sides)
    turning = iter(_enter_turning(courses, edges, hull_growth, reserve_m))
    return [straight if circle is None else next(turning) for circle in courses.circles]


def _enter_straight(line: Line, side: _Side, hull_growth: OneOrEach, reserve_m: float) -> Contact:
    """Return the first time at which a point, moving along -v, enters the grown hull through this edge."""
    if side.nx <= 0.0:
        return NEVER
    height = side.offset + hull_growth
    rightmost = side.ny * height + side.nx * (side.low + hull_growth * side.low_stretch)
    leftmost = side.ny * height + side.nx * (side.high + hull_growth * side.high_stretch)
    rows = ((line.track >= rightmost) & (line.track <= leftmost)).nonzero()[0]
    if not len(rows):
        return NEVER
    left_m = line.x.take(rows) - (_of(height, rows) - side.ny * line.track.take(rows)) / side.nx
    return _first(rows, np.where(left_m >= 0.0, left_m, np.inf) - reserve_m, line.v)


def _entrances(
    edges: Edges, direction: Direction, hull_growth: OneOrEach, rho: float, sense: float
) -> list[tuple[OneOrEach, OneOrEach, OneOrEach, float]]:
    """Return the grown edges as seen from C, which is `rho` to the left (`sense` 1) or right (-1).

    For each edge: the distance of its line along its normal; the least and greatest D^2 of points that enter
    through it; the angle of its normal. Plain numbers, if `hull_growth` is one number.
    """
    left = sense * rho
    entrances = []
    for nx, ny, offset, low, high, low_stretch, high_stretch, facing_left, facing_right in _sides(
        edges, direction
    ):
        height = offset + hull_growth - ny * left
        from_, to = low + hull_growth * low_stretch - nx * left, high + hull_growth * high_stretch - nx * left
        begin, end, facing = (-to, -from_, facing_left) if sense > 0.0 else (from_, to, facing_right)
        if isinstance(hull_growth, float):
            begin, end = begin if begin > 0.0 else 0.0, end if end > 0.0 else 0.0
        else:
            begin, end = np.maximum(begin, 0.0), np.maximum(end, 0.0)
        across = height * height
        entrances.append((height, begin * begin + across, end * end + across, facing))
    return entrances


def _enter_turning(courses: Courses, edges: Edges, hull_growth: OneOrEach, reserve_m: float) -> list[Contact]:
    """Return for each twist the first time at which a point, on its circle about C, enters the grown hull.

    The circle of radius D crosses an edge's line at angles of -+arccos(height / D) from the normal, and
    enters at the minus sign, counted in the turning sense. All twists, edges and points are computed at once:
    a call of numpy costs more than its arithmetic.
    """
    circles = [circle for circle in courses.circles if circle is not None]
    if not circles:
        return []
    if len(circles) == 1:
        radial, all_squares = circles[0].radial, circles[0].squares[None]
    else:
        radial = np.array([circle.radial for circle in circles])
        all_squares = np.array([circle.squares for circle in circles])
    each = [_entrances(edges, courses.direction, hull_growth, circle.rho, circle.sense) for circle in circles]
    number, points = len(each[0]), len(courses.line.x)
    lines, nearest, farthest, facing = zip(*chain(*each), strict=True)
    shape, squares = (len(circles), number, -1), all_squares[:, None]
    within = squares > np.array(nearest).reshape(shape)
    within &= squares <= np.array(farthest).reshape(shape)
    hits = within.ravel().nonzero()[0]
    if not len(hits):
        return [NEVER] * len(circles)
    through = hits // points  # which edge of which circle
    rows = hits - points * through
    heights = np.array(lines)
    known = rows if len(circles) == 1 else rows + points * (through // number)  # index in the tables
    d = np.sqrt(all_squares.take(known))
    onward = np.arctan2(courses.line.x.take(rows), radial.take(known))
    onward -= np.array(facing).take(through)
    onward += np.arccos(heights.take(through if heights.ndim == 1 else hits) / d)
    angles = np.mod(onward, math.tau)
    if reserve_m:
        angles -= reserve_m / d
    if len(circles) == 1:
        return [_first(rows, angles, circles[0].turning)]
    begins = through.searchsorted([number * circle for circle in range(len(circles) + 1)]).tolist()
    return [
        _first(rows[begin:end], angles[begin:end], circle.turning)
        for circle, begin, end in zip(circles, begins, begins[1:], strict=False)
    ]


def polygon_meets_s(
    x: float,
    y: float,
    direction: Direction,
    twist: Velocity,
    edges: Edges,
    hull_growth_m: float,
    reserve_m: float,
) -> float:
    """Return the time until a twist that turns brings the grown polygon to one point.

    The point is seen along the twist's direction. The reserve is subtracted. Same as `polygon_contacts`, in
    plain numbers. Infinity: never, or the twist is straight.
    """
    v = speed(twist)
    if abs(twist.w) <= STRAIGHT_PER_M * v:
        return math.inf
    rho, sense = v / abs(twist.w), math.copysign(1.0, twist.w)
    radial = rho - sense * y
    squares = radial * radial + x * x
    d, bearing, onward = math.sqrt(squares), math.atan2(x, radial), math.inf
    for height, nearest, farthest, facing in _entrances(edges, direction, hull_growth_m, rho, sense):
        if nearest < squares <= farthest:
            onward = min(onward, (bearing - facing + math.acos(height / d)) % math.tau)
    return (onward - reserve_m / d) / abs(twist.w) if d else math.inf
