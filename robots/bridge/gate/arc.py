"""When the hull first touches a point, if the twist stays as it is (GATE.md, method 1).

A robot with a constant twist turns about the centre of rotation C = (-vy/w, vx/w); in its own base frame
each point of the world then runs on a circle about C, the other way round. `Lines` and `Circles` hold these
courses, of several twists at once: calling numpy costs more than the arithmetic does. Contact times are in
seconds, infinity for never; they are those of points outside the hull.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.planar import Points
from robots.bridge.gate.values import Velocity

Times = NDArray[np.float64]
Metres = NDArray[np.float64]
Rows = NDArray[np.intp]

STRAIGHT_PER_M = 0.001  # |w| <= 0.001 |v| counts as straight: a turning circle of more than a kilometre
_TINY = 1e-12
_HAIR_M = 1e-9  # added to both ends of an edge: between two nothing slips through


def speed(twist: Velocity) -> float:
    """How fast the base origin moves, m/s."""
    return math.hypot(twist.vx, twist.vy)


def is_straight(twist: Velocity) -> bool:
    """Whether the turning is too little to tell the arc from a line."""
    return abs(twist.w) <= STRAIGHT_PER_M * speed(twist)


def centre(twist: Velocity) -> tuple[float, float]:
    """Centre of rotation C in the base frame, metres. Not for a straight twist."""
    return -twist.vy / twist.w, twist.vx / twist.w


class Lines(NamedTuple):
    """Points that run straight past the base, of one twist (1, N): `ahead` along its way, `track` to the left of it."""

    twists: tuple[Velocity, ...]
    ahead: Metres
    track: Metres


class Circles(NamedTuple):
    """Points that run on circles about C, of several twists (twists, N): (x, y) seen from C, `track` the distance."""

    twists: tuple[Velocity, ...]
    centre_x: Metres
    centre_y: Metres
    w: Metres
    x: Metres
    y: Metres
    track: Metres


Courses = Lines | Circles


class Contacts(NamedTuple):
    """Which twist (its number, ascending) touches which point (its row), after how many seconds.

    `speeds` are those at which the points come nearer along their courses, m/s.
    """

    twists: Rows
    rows: Rows
    times: Times
    speeds: Metres


def courses(points: Points, twists: Sequence[Velocity]) -> Iterator[Courses]:
    """How points of the base frame run past it: on lines for each straight twist, on circles for the others."""
    x, y = points.T
    for twist in twists:
        if is_straight(twist):
            v = speed(twist)
            ahead, track = (twist.vx * x + twist.vy * y) / v, (twist.vx * y - twist.vy * x) / v
            yield Lines((twist,), ahead[None], track[None])
    turning = tuple(twist for twist in twists if not is_straight(twist))
    if turning:
        columns = np.array([(*centre(twist), twist.w) for twist in turning])
        cx, cy, w = columns.T[..., None]
        qx, qy = x - cx, y - cy
        yield Circles(turning, cx, cy, w, qx, qy, np.sqrt(qx * qx + qy * qy))


def track(x: float, y: float, twist: Velocity) -> float:
    """The track of one point of the base frame."""
    if is_straight(twist):
        return (twist.vx * y - twist.vy * x) / speed(twist)
    cx, cy = centre(twist)
    return math.hypot(x - cx, y - cy)


def disc_contacts(courses: Courses, discs: NDArray[np.float64], growth: Metres) -> Contacts:
    """Contacts with discs (x, y, radius) grown by `growth`, one for all points or one for each."""
    x, y, radius = discs.T[..., None]
    if isinstance(courses, Lines):
        return _discs_straight(courses, x, y, radius + growth)
    return _discs_turning(courses, x, y, radius + growth)


def _discs_straight(courses: Lines, x: Metres, y: Metres, radius: Metres) -> Contacts:
    """t = (x - sqrt(r^2 - y^2)) / v, with x along the motion. Arrays over discs are (1, discs, N)."""
    (twist,) = courses.twists
    v = speed(twist)
    ahead = courses.ahead[:, None] - (twist.vx * x + twist.vy * y) / v
    aside = np.abs(courses.track[:, None] - (twist.vx * y - twist.vy * x) / v)
    number, disc, row = places((aside < radius) & (ahead > 0.0))
    half_chord = np.sqrt(radius[disc, _columns(row, radius[0])] ** 2 - aside[0, disc, row] ** 2)
    times = np.maximum(ahead[0, disc, row] - half_chord, 0.0) / v
    return Contacts(number, row, times, np.full(len(row), v))


def _discs_turning(courses: Circles, x: Metres, y: Metres, radius: Metres) -> Contacts:
    """t = (phi - Delta) / |w|, Delta = arccos((D^2 + rho^2 - r^2) / (2 D rho)).

    rho and phi are those of the disc's middle. Arrays over discs are (twists, discs, N).
    """
    mx, my = x - courses.centre_x[:, None], y - courses.centre_y[:, None]
    rho = np.sqrt(mx * mx + my * my)
    number, disc, row = places(np.abs(courses.track[:, None] - rho) < radius)
    begin = np.arctan2(my, mx)[number, disc, 0]
    rho, d, w = rho[number, disc, 0], courses.track[number, row], courses.w[number, 0]
    r = radius[disc, _columns(row, radius[0])]
    phi = np.mod(np.sign(w) * (np.arctan2(courses.y[number, row], courses.x[number, row]) - begin), math.tau)
    cos_delta = (d * d + rho * rho - r * r) / np.maximum(2.0 * d * rho, _TINY)
    delta = np.arccos(np.minimum(np.maximum(cos_delta, -1.0), 1.0))
    turning = np.abs(w)
    return Contacts(number, row, np.maximum(phi - delta, 0.0) / turning, turning * d)


def _columns(rows: Rows, values: Metres) -> Rows | int:
    """Where in `values`, (1,) or (N,), those of these rows are."""
    return rows if len(values) > 1 else 0


def places(marked: NDArray[np.bool_]) -> tuple[Rows, ...]:
    """As `np.nonzero`, at a third of the cost."""
    return np.unravel_index(np.flatnonzero(marked), marked.shape)


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
        self._ends = np.stack((low - _HAIR_M, low + lengths + _HAIR_M))[..., None]
        self._stretch = np.stack((-low_stretch, np.roll(low_stretch, -1)))[..., None]
        self.headings = np.arctan2(self.normals[:, 1], self.normals[:, 0])
        self.corner_stretch = 1.0 / np.cos(bends / 2.0)

    def gaps(self, points: Points) -> NDArray[np.float64]:
        """How far each point lies beyond the edge it is farthest beyond; negative inside.

        So the points with gap m are the outline grown by m.
        """
        gaps: NDArray[np.float64] = self.beyond(points).max(axis=0)
        return gaps

    def ends(self, growth: Metres) -> Metres:
        """Where along its line each edge begins and ends once it is grown, (2, edges, N)."""
        ends: Metres = self._ends + growth * self._stretch
        return ends

    def beyond(self, points: Points) -> NDArray[np.float64]:
        """How far each point lies beyond each edge's line, (edges, N).

        Written out, since BLAS might start threads, which cost more than this.
        """
        x, y = points.T
        (nx, ny), offsets = self.normals.T[..., None], self.offsets[:, None]
        distances: NDArray[np.float64] = nx * x + ny * y - offsets
        return distances


def polygon_contacts(courses: Courses, edges: Edges, growth: Metres) -> Contacts:
    """Contacts with a convex polygon grown by `growth`, one for all points or one for each.

    A point comes in through an edge if its track lies between those of the edge's ends.
    """
    if isinstance(courses, Lines):
        return _enter_straight(courses, edges, growth)
    return _enter_turning(courses, edges, growth)


def _enter_straight(courses: Lines, edges: Edges, growth: Metres) -> Contacts:
    """When each point, moving along -v, comes in through an edge. Arrays over edges are (edges, N)."""
    (twist,) = courses.twists
    v = speed(twist)
    nx, ny = edges.normals.T[..., None]
    ahead, left = (nx * twist.vx + ny * twist.vy) / v, (ny * twist.vx - nx * twist.vy) / v  # of each normal
    height = edges.offsets[:, None] + growth
    low, high = edges.ends(growth)
    rightmost, leftmost = left * height + ahead * low, left * height + ahead * high
    edge, row = places((ahead > 0.0) & (courses.track >= rightmost) & (courses.track <= leftmost))
    height = height[edge, _columns(row, growth)]
    ahead, left = ahead[edge, 0], left[edge, 0]
    way = courses.ahead[0, row] - (height - left * courses.track[0, row]) / ahead
    times = np.where(way >= 0.0, way, np.inf) / v
    return Contacts(np.zeros_like(row), row, times, np.full(len(row), v))


def _enter_turning(courses: Circles, edges: Edges, growth: Metres) -> Contacts:
    """When each point, on its circle about C, comes in through an edge. Arrays over edges are (twists, edges, N).

    An edge's line is `height` away from C along its normal; the circle of radius D crosses it at
    -+sqrt(D^2 - height^2) along the edge, and comes in at the minus sign when the robot turns left, at the
    plus sign when it turns right.
    """
    (nx, ny), (ux, uy) = edges.normals.T[..., None], edges.along.T[..., None]
    cx, cy, w = courses.centre_x[:, None], courses.centre_y[:, None], courses.w[:, None]
    height = edges.offsets[:, None] + growth - nx * cx - ny * cy
    ends = edges.ends(growth)[:, None] - (ux * cx + uy * cy)
    entering_side = np.where(w > 0.0, -ends[::-1], ends)
    nearest, farthest = np.hypot(height, np.maximum(entering_side, 0.0))
    track = courses.track[:, None]
    number, edge, row = places((track > nearest) & (track <= farthest))
    d, turning = courses.track[number, row], courses.w[number, 0]
    height = height[number, edge, _columns(row, growth)]
    sideways = np.sqrt(np.maximum(d * d - height * height, 0.0))
    entry = edges.headings[edge] + np.arctan2(np.copysign(sideways, -turning), height)
    phi = np.arctan2(courses.y[number, row], courses.x[number, row])
    speeds = np.abs(turning)
    angle = np.mod(np.sign(turning) * (phi - entry), math.tau)
    return Contacts(number, row, angle / speeds, speeds * d)
