"""The hull as a disc, several discs or a convex polygon: gaps, contacts and clearances."""

from __future__ import annotations

import math
from functools import reduce
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from robots.shared.configuration.gate_profile import GateProfile
from robots.shared.geometry import arc
from robots.shared.geometry.arc import Contact, Courses, Direction, Metres, OneOrEach
from robots.shared.geometry.planar import Drift, Path, Points, from_columns
from robots.shared.geometry.poses import Pose, Velocity

Band = tuple[float, float]
Quick = NDArray[np.float32]  # a roll-out compares thousands of poses: an error of 2 um is small enough there


class Spread(NamedTuple):
    """How far the base may be from a pose (metres, in the base's directions there) and turned (radians).

    No number is negative. More than a quarter turn counts as any turn.
    """

    ahead: float
    behind: float
    left: float
    right: float
    turned_left: float
    turned_right: float


class Footprint(Protocol):
    """Interface of a hull. Points are (N, 2) in the base frame.

    * `demanded_share`: the part of a too narrow gap that must remain while the robot moves away.
    * `pose_spacing_m`: distance between two checked poses of a roll-out; between them gaps are hardly smaller.
    * `turns_freely`: a turn on the spot touches no point.
    * `sharpness`: largest ratio of a point's distance to its gap; beyond corners, gaps count from edge lines.
    """

    demanded_share: float
    pose_spacing_m: float
    turns_freely: bool
    sharpness: float

    def reach(self, hull_growth_m: float) -> float:
        """Return the radius about the base origin that holds the hull grown by `hull_growth_m`."""

    def gaps(self, points: Points) -> Metres:
        """Return how far each point lies outside the hull; negative inside."""

    def gaps_about(self, there: Pose, spread: Spread, points: Points, near_m: float) -> Metres:
        """Return a lower bound of each point's gap if the base may be anywhere in this spread about `there`.

        Above `near_m`, the number only shows that the gap is larger than `near_m`.
        """

    def contacts(self, courses: Courses, hull_growth: OneOrEach, reserve_m: float) -> list[Contact]:
        """Return for each twist the first contact of the grown hull with one of the points outside.

        `reserve_m`: distance on the path that must be left; the time for it is subtracted.
        """

    def meets_s(
        self,
        x: float,
        y: float,
        direction: Direction,
        twist: Velocity,
        hull_growth_m: float,
        reserve_m: float,
    ) -> float:
        """Return the time (s) until the grown hull touches one point, minus the reserve.

        `x`, `y`: the point seen along the direction. Infinity: never, or the computation costs too much.
        """
        return math.inf

    def bands(self, twist: Velocity) -> list[Band]:
        """Return the tracks (`arc.track`) that the hull sweeps on this arc."""

    def least_gaps(self, path: Path, points: Points, drift: Drift | None = None) -> Quick:
        """Return the least gap of each point on each row of a path, (rows, N).

        Points with a drift move with the path's time, and the gap counts from the discs about them.
        """


class Disc:
    """A disc about the base origin."""

    demanded_share = 1.0  # a disc that moves away from a point need not come nearer to it first
    pose_spacing_m = 0.04
    turns_freely = True
    sharpness = 1.0

    def __init__(self, radius_m: float) -> None:
        if not (math.isfinite(radius_m) and radius_m > 0.0):
            raise ValueError("The radius of a footprint must be above zero.")
        self.radius_m = radius_m

    def reach(self, hull_growth_m: float) -> float:
        return self.radius_m + hull_growth_m

    def gaps(self, points: Points) -> Metres:
        x, y = points.T
        gaps: Metres = np.sqrt(x**2 + y**2) - self.radius_m
        return gaps

    def gaps_about(self, there: Pose, spread: Spread, points: Points, near_m: float) -> Metres:
        return _disc_gaps_about(there, 0.0, 0.0, self.radius_m, spread, points, near_m)

    def contacts(self, courses: Courses, hull_growth: OneOrEach, reserve_m: float) -> list[Contact]:
        firsts = arc.disc_contacts(courses, 0.0, 0.0, self.radius_m + hull_growth, 0.0)
        # A turn on the spot brings a disc no nearer to a point: the reserve counts on the base's path.
        return [
            first if first is arc.NEVER else Contact(first.until_s - reserve_m / courses.v, first.row)
            for first in firsts
        ]

    def meets_s(
        self,
        x: float,
        y: float,
        direction: Direction,
        twist: Velocity,
        hull_growth_m: float,
        reserve_m: float,
    ) -> float:
        return arc.disc_meets_s(x, y, twist, self.radius_m + hull_growth_m, reserve_m)

    def bands(self, twist: Velocity) -> list[Band]:
        return [_disc_band(0.0, 0.0, self.radius_m, twist)]

    def least_gaps(self, path: Path, points: Points, drift: Drift | None = None) -> Quick:
        return _least_distances(path, points, drift) - np.float32(self.radius_m)


class Discs(Footprint):
    """Several discs, fixed to each other: a long base, or an arm that reaches out. Their union is the hull."""

    # while the hull turns away from a wall, one disc may first come a little nearer to it
    demanded_share = 0.5
    pose_spacing_m = 0.04
    turns_freely = False
    sharpness = 1.0

    def __init__(self, discs: tuple[tuple[float, float, float], ...]) -> None:
        """`discs` are (x, y, radius) in the base frame, metres."""
        if not discs:
            raise ValueError("A footprint of discs needs at least one.")
        if not all(math.isfinite(x) and math.isfinite(y) for x, y, _ in discs):
            raise ValueError("The middle of each disc must be two numbers.")
        self._discs = [(x, y, Disc(radius_m)) for x, y, radius_m in discs]
        self._middles = np.array([(x, y) for x, y, _ in discs])

    def reach(self, hull_growth_m: float) -> float:
        return max(math.hypot(x, y) + disc.reach(hull_growth_m) for x, y, disc in self._discs)

    def gaps(self, points: Points) -> Metres:
        return _least([disc.gaps(_from(points, x, y)) for x, y, disc in self._discs])

    def gaps_about(self, there: Pose, spread: Spread, points: Points, near_m: float) -> Metres:
        turned = max(spread.turned_left, spread.turned_right)
        each = []
        for x, y, disc in self._discs:
            swing_m = math.hypot(x, y) * min(turned, 2.0)  # no chord is longer than the diameter
            each.append(_disc_gaps_about(there, x, y, disc.radius_m + swing_m, spread, points, near_m))
        return _least(each)

    def contacts(self, courses: Courses, hull_growth: OneOrEach, reserve_m: float) -> list[Contact]:
        middles = arc.seen_along(self._middles, courses.direction).tolist()
        each = [
            arc.disc_contacts(courses, x, y, disc.radius_m + hull_growth, reserve_m)
            for (x, y), (_, _, disc) in zip(middles, self._discs, strict=True)
        ]
        return [min(firsts) for firsts in zip(*each, strict=True)]

    def bands(self, twist: Velocity) -> list[Band]:
        return [_disc_band(x, y, disc.radius_m, twist) for x, y, disc in self._discs]

    def least_gaps(self, path: Path, points: Points, drift: Drift | None = None) -> Quick:
        cos, sin = np.cos(path.yaw), np.sin(path.yaw)
        least: Quick = np.minimum.reduce(
            [
                disc.least_gaps(
                    path._replace(x=path.x + cos * x - sin * y, y=path.y + sin * x + cos * y), points, drift
                )
                for x, y, disc in self._discs
            ]
        )
        return least


class Polygon:
    """A convex outline, counter-clockwise."""

    demanded_share = 0.5  # while the hull turns away from a wall, a corner may first come a little nearer
    pose_spacing_m = 0.025
    turns_freely = False

    def __init__(self, outline: tuple[tuple[float, float], ...]) -> None:
        self.edges = arc.Edges(outline)
        self.sharpness = float(self.edges.corner_stretch.max())
        self._corners = [(float(x), float(y)) for x, y in outline]
        lengths = self.edges.lengths.tolist()
        self._sides = list(zip(self._corners, self.edges.along.tolist(), lengths, strict=True))
        along = self.edges.along @ self.edges.vertices.T  # of each edge: the corners' coordinates along it
        before, after = -along.min(axis=1), along.max(axis=1)
        # of each edge: its line, how far the hull reaches to either side of the normal, and the turns that bring a
        # corner farthest out
        peaks = np.arctan2(before, self.edges.offsets), np.arctan2(after, self.edges.offsets)
        columns = *self.edges.normals.T, self.edges.offsets, before, after, *peaks
        self._lines = np.array(columns).T.tolist()
        self._columns = np.array((*self.edges.normals.T, self.edges.offsets))[..., None, None]
        distances: list[float] = np.hypot(*self.edges.vertices.T).tolist()
        reaches = set(zip(distances, self.edges.corner_stretch.tolist(), strict=True))
        self._corner_reaches: list[tuple[float, float]] = sorted(reaches)  # equal corners have one entry

    def reach(self, hull_growth_m: float) -> float:
        return max([distance + hull_growth_m * stretch for distance, stretch in self._corner_reaches])

    def gaps(self, points: Points) -> Metres:
        return self.edges.gaps(points)

    def gaps_about(self, there: Pose, spread: Spread, points: Points, near_m: float) -> Metres:
        """Multiply the points once with the edges' lines at `there`, each as far out as it can get."""
        cos, sin = math.cos(there.yaw), math.sin(there.yaw)
        ahead, behind, left, right, turned_left, turned_right = spread
        reach_m = self.reach(0.0) if max(turned_left, turned_right) > math.pi / 2.0 else 0.0
        cos_left, sin_left = math.cos(turned_left), math.sin(turned_left)
        cos_right, sin_right = math.cos(turned_right), math.sin(turned_right)
        normals, offsets = np.empty((len(self._lines), 2)), np.empty((len(self._lines), 1))
        for row, (nx, ny, offset, before, after, peak_left, peak_right) in enumerate(self._lines):
            normals[row, 0] = across = cos * nx - sin * ny
            normals[row, 1] = up = sin * nx + cos * ny
            # How far out along the normal the hull swings: a corner (offset, aside) moves on a circle about
            # the origin.
            if reach_m:
                out = reach_m
            else:
                out = max(
                    offset,
                    math.hypot(offset, before)
                    if 0.0 <= peak_left <= turned_left
                    else cos_left * offset + sin_left * before,
                    math.hypot(offset, after)
                    if 0.0 <= peak_right <= turned_right
                    else cos_right * offset + sin_right * after,
                )
            out += (nx * ahead if nx > 0.0 else -nx * behind) + (ny * left if ny > 0.0 else -ny * right)
            offsets[row, 0] = out + across * there.x + up * there.y
        beyond = normals @ points.T
        beyond -= offsets
        gaps: Metres = np.maximum.reduce(beyond)
        return gaps

    def contacts(self, courses: Courses, hull_growth: OneOrEach, reserve_m: float) -> list[Contact]:
        return arc.polygon_contacts(courses, self.edges, hull_growth, reserve_m)

    def meets_s(
        self,
        x: float,
        y: float,
        direction: Direction,
        twist: Velocity,
        hull_growth_m: float,
        reserve_m: float,
    ) -> float:
        return arc.polygon_meets_s(x, y, direction, twist, self.edges, hull_growth_m, reserve_m)

    def bands(self, twist: Velocity) -> list[Band]:
        if arc.is_straight(twist):
            tracks = [arc.track(x, y, twist) for x, y in self._corners]
            return [(min(tracks), max(tracks))]
        return [self._ring(*arc.centre(twist))]

    def least_gaps(self, path: Path, points: Points, drift: Drift | None = None) -> Quick:
        """Each edge of each pose is a half-plane; its distances to all points are one row of the product."""
        cos, sin = np.cos(path.yaw), np.sin(path.yaw)
        nx, ny, offsets = self._columns
        across, up = cos * nx - sin * ny, sin * nx + cos * ny  # (edges, rows, poses), normals in the world
        away = -(across * path.x + up * path.y + offsets)
        planes: list[Metres | float] = [across, up, away]
        moments: list[Metres | float] = [*points.T, 1.0]
        if drift is not None:
            planes += [path.time_s * across, path.time_s * up, -1.0, -path.time_s]
            moments += [*drift.velocity.T, drift.radius, drift.grows]
        beyond = _product(planes, across.shape, moments, points.shape[:1])
        least: Quick = np.minimum.reduce(np.maximum.reduce(beyond), axis=1)
        return least

    def _ring(self, cx: float, cy: float) -> tuple[float, float]:
        """Return the least (0 if the point is inside) and the greatest distance of the hull from (cx, cy).

        Plain numbers: for a few corners they are quicker than arrays.
        """
        farthest = max(math.hypot(x - cx, y - cy) for x, y in self._corners)
        nearest, inside = math.inf, True
        for (x, y), (ux, uy), length in self._sides:
            dx, dy = cx - x, cy - y
            along, beyond = ux * dx + uy * dy, uy * dx - ux * dy
            inside = inside and beyond <= 0.0
            nearest = min(nearest, math.hypot(beyond, along - min(max(along, 0.0), length)))
        return 0.0 if inside else nearest, farthest


def clearances(tracks: Metres, twist: Velocity, footprint: Footprint) -> Metres:
    """Return the clearance of points on these tracks from the area that the hull sweeps; negative inside."""
    beside = [np.maximum(low - tracks, tracks - high) for low, high in footprint.bands(twist)]
    return reduce(np.minimum, beside)


def footprint_of(profile: GateProfile) -> Footprint:
    """Return the hull that a profile describes. Raises ValueError if it describes none."""
    if profile.discs is not None:
        return Discs(profile.discs)
    if profile.outline is not None:
        return Polygon(profile.outline)
    if profile.radius_m is None:
        raise ValueError("A profile needs a radius, an outline or discs.")
    return Disc(profile.radius_m)


def _from(points: Points, x: float, y: float) -> Points:
    """Return the points relative to (x, y)."""
    return from_columns(points[:, 0] - x, points[:, 1] - y)


def _disc_band(x: float, y: float, radius_m: float, twist: Velocity) -> Band:
    """Return the tracks that a disc about (x, y) sweeps: a strip, or a ring about the centre of rotation."""
    middle = arc.track(x, y, twist)
    return middle - radius_m, middle + radius_m


def _disc_gaps_about(
    there: Pose, at_x: float, at_y: float, radius_m: float, spread: Spread, points: Points, near_m: float
) -> Metres:
    """Return the gaps of a disc about (`at_x`, `at_y`) of the base, as in `Footprint.gaps_about`.

    A gap is the distance from the box in which the disc's middle may be, minus the radius. Points that are
    far from the circle about this box get the distance from the circle, which costs less.
    """
    x, y = points.T
    ahead, behind, left, right, _, _ = spread
    cos, sin = math.cos(there.yaw), math.sin(there.yaw)
    # The middle of the box, in the directions of the base.
    box_x = at_x + (ahead - behind) / 2.0
    box_y = at_y + (left - right) / 2.0
    half_x, half_y = (ahead + behind) / 2.0, (left + right) / 2.0
    dx = x - (there.x + cos * box_x - sin * box_y)
    dy = y - (there.y + sin * box_x + cos * box_y)
    gaps: Metres = np.sqrt(dx * dx + dy * dy)
    gaps -= radius_m + math.hypot(half_x, half_y)
    rows = (gaps <= near_m).nonzero()[0]
    if len(rows):
        dx, dy = dx.take(rows), dy.take(rows)
        aside_x = np.maximum(np.abs(cos * dx + sin * dy) - half_x, 0.0)
        aside_y = np.maximum(np.abs(cos * dy - sin * dx) - half_y, 0.0)
        gaps[rows] = np.sqrt(aside_x * aside_x + aside_y * aside_y) - radius_m
    return gaps


def _least(arrays: list[Metres]) -> Metres:
    least: Metres = np.minimum.reduce(arrays)
    return least


def _least_distances(path: Path, points: Points, drift: Drift | None) -> Quick:
    """Return least distances of points p + u t from pose origins c: |p|^2 - 2 p.c + |c|^2, and terms of u.

    With a drift they are distances of discs, whose radii r + g t are subtracted at each pose.
    """
    x, y, time_s = path.x, path.y, path.time_s
    px, py = points.T
    places: list[Metres | float] = [x**2 + y**2, 1.0, -2.0 * x, -2.0 * y]
    moments: list[Metres | float] = [1.0, px**2 + py**2, px, py]
    if drift is not None:
        ux, uy = drift.velocity.T
        places += [2.0 * time_s, time_s**2, -2.0 * time_s * x, -2.0 * time_s * y]
        moments += [px * ux + py * uy, ux**2 + uy**2, ux, uy]
    squares = _product(places, x.shape, moments, px.shape)
    if drift is None:
        distances: Quick = np.sqrt(np.maximum(squares.min(axis=1), np.float32(0.0)))
        return distances
    away = np.sqrt(np.maximum(squares, np.float32(0.0)))
    away -= _product([1.0, time_s], x.shape, [drift.radius, drift.grows], px.shape)
    least: Quick = away.min(axis=1)
    return least


def _product(
    places: list[Metres | float],
    poses: tuple[int, ...],
    moments: list[Metres | float],
    points: tuple[int, ...],
) -> Quick:
    """Return the matrix product of the terms of poses and points, (*poses, N)."""
    rows = _stacked(places, poses).reshape(len(places), -1).T.copy()
    product: Quick = (rows @ _stacked(moments, points)).reshape(*poses, -1)
    return product


def _stacked(parts: list[Metres | float], shape: tuple[int, ...]) -> Quick:
    stacked: Quick = np.empty((len(parts), *shape), dtype=np.float32)
    for row, part in zip(stacked, parts, strict=True):
        row[...] = part
    return stacked
