"""When the hull first touches a point, if the twist stays as it is (GATE.md, method 1).

A robot with a constant twist turns about the centre of rotation C = (-vy/w, vx/w); in its own base frame
each point of the world then runs on a circle about C, the other way round. All functions take points (N, 2)
in the base frame and return one time per point in seconds, infinity for never. A point that is inside
already counts as touched now if the motion takes it deeper, else when it comes back in.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.planar import Points
from robots.bridge.gate.values import Velocity

Times = NDArray[np.float64]

STRAIGHT_PER_M = 0.001  # |w| <= 0.001 |v| counts as straight: a turning circle of more than a kilometre
_TINY_M = 1e-12


def speed(twist: Velocity) -> float:
    """How fast the base origin moves, m/s."""
    return math.hypot(twist.vx, twist.vy)


def is_straight(twist: Velocity) -> bool:
    """Whether the turning is too little to tell the arc from a line."""
    return abs(twist.w) <= STRAIGHT_PER_M * speed(twist)


def centre(twist: Velocity) -> tuple[float, float]:
    """Centre of rotation C in the base frame, metres. Not for a straight twist."""
    return -twist.vy / twist.w, twist.vx / twist.w


def disc_contact_times(points: Points, twist: Velocity, radius: NDArray[np.float64]) -> Times:
    """Contact times with a disc about the base origin, whose radius is given for each point."""
    if speed(twist) == 0.0:
        return np.full(len(points), np.inf)  # a disc that turns on the spot touches nothing new
    if is_straight(twist):
        return _disc_straight(points, twist, radius)
    return _disc_turning(points, twist, radius)


def _disc_straight(points: Points, twist: Velocity, radius: NDArray[np.float64]) -> Times:
    """t = (x - sqrt(r^2 - y^2)) / v, with x along the motion."""
    v = speed(twist)
    x, y = points.T
    along = (twist.vx * x + twist.vy * y) / v
    across = (twist.vx * y - twist.vy * x) / v
    half_chord_squared = radius**2 - across**2
    half_chord = np.sqrt(np.maximum(half_chord_squared, 0.0))
    times: Times = np.maximum(along - half_chord, 0.0) / v
    times[(half_chord_squared <= 0.0) | (along <= 0.0)] = np.inf
    return times


def _disc_turning(points: Points, twist: Velocity, radius: NDArray[np.float64]) -> Times:
    """t = (phi - Delta) / |w|, Delta = arccos((D^2 + rho^2 - r^2) / (2 D rho))."""
    cx, cy = centre(twist)
    rho = math.hypot(cx, cy)
    x, y = points.T
    qx, qy = x - cx, y - cy
    distance_squared = qx**2 + qy**2
    doubled = 2.0 * rho * np.maximum(np.sqrt(distance_squared), _TINY_M)
    cos_delta = (distance_squared + rho**2 - radius**2) / doubled
    times = np.full(len(points), np.inf)
    met = np.flatnonzero(cos_delta < 1.0)
    if len(met):
        qx, qy = qx[met], qy[met]
        turning = math.copysign(1.0, twist.w)
        cross, dot = cy * qx - cx * qy, -cx * qx - cy * qy
        phi = np.mod(turning * np.arctan2(cross, dot), math.tau)
        delta = np.arccos(np.maximum(cos_delta[met], -1.0))
        times[met] = np.maximum(phi - delta, 0.0) / abs(twist.w)
    return times


class Edges:
    """The edges of a convex polygon, counter-clockwise, ready to be grown outwards by a margin.

    Edge i lies where normal_i . p = offset_i; along it, u_i . p runs from low_i to high_i (u_i is the normal
    turned left). Growing by m moves each edge out by m and lengthens its ends by m times `low_stretch` and
    `high_stretch`: corners stay sharp.
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
        self.low = (along * vertices).sum(axis=1)
        self.high = self.low + lengths
        self.low_stretch = np.tan(bends / 2.0)
        self.high_stretch = np.roll(self.low_stretch, -1)
        self.corner_stretch = 1.0 / np.cos(bends / 2.0)

    def gaps(self, points: Points) -> NDArray[np.float64]:
        """How far each point lies beyond the edge it is farthest beyond; negative inside.

        So the points with gap m are the outline grown by m.
        """
        gaps: NDArray[np.float64] = self.beyond(points).max(axis=0)
        return gaps

    def beyond(self, points: Points) -> NDArray[np.float64]:
        """How far each point lies beyond each edge's line, (edges, N).

        Written out, since BLAS might start threads, which cost more than this.
        """
        x, y = points.T
        (nx, ny), offsets = self.normals.T[..., None], self.offsets[:, None]
        distances: NDArray[np.float64] = nx * x + ny * y - offsets
        return distances


def polygon_contact_times(
    points: Points, twist: Velocity, edges: Edges, growth: NDArray[np.float64]
) -> Times:
    """Contact times with a convex polygon grown by `growth`, which is given for each point."""
    if not any(twist) or not len(points):
        return np.full(len(points), np.inf)
    times = (_enter_straight if is_straight(twist) else _enter_turning)(points, twist, edges, growth)
    beyond = edges.beyond(points)
    inside = np.flatnonzero(beyond.max(axis=0) < growth)
    if len(inside):
        times[inside[_going_deeper(points[inside], twist, edges, beyond[:, inside].argmax(axis=0))]] = 0.0
    return times


def _enter_straight(points: Points, twist: Velocity, edges: Edges, growth: NDArray[np.float64]) -> Times:
    """When each point, moving along -v, first comes in through an edge. Arrays over edges are (edges, N)."""
    x, y = points.T
    (nx, ny), (ux, uy) = edges.normals.T[..., None], edges.along.T[..., None]
    closing = nx * twist.vx + ny * twist.vy
    towards = closing > 0.0
    entry = (edges.beyond(points) - growth) / np.where(towards, closing, np.inf)
    at = ux * x + uy * y - (ux * twist.vx + uy * twist.vy) * entry
    through = towards & (entry >= 0.0) & _on_edge(at, edges, growth)
    times: Times = np.where(through, entry, np.inf).min(axis=0)
    return times


def _enter_turning(points: Points, twist: Velocity, edges: Edges, growth: NDArray[np.float64]) -> Times:
    """When each point, on its circle about C, first comes in through an edge. Arrays over edges are (edges, N).

    An edge's line is `height` away from C along its normal; the circle of radius D crosses it at
    -+sqrt(D^2 - height^2) along the edge, and comes in at the minus sign when the robot turns left, at the
    plus sign when it turns right.
    """
    cx, cy = centre(twist)
    turning = math.copysign(1.0, twist.w)
    x, y = points.T
    qx, qy = x - cx, y - cy
    normals, along = edges.normals, edges.along
    height = (edges.offsets - normals[:, 0] * cx - normals[:, 1] * cy)[:, None] + growth
    half_chord_squared = qx**2 + qy**2 - height**2
    sideways = -turning * np.sqrt(np.maximum(half_chord_squared, 0.0))
    at = (along[:, 0] * cx + along[:, 1] * cy)[:, None] + sideways
    edge, point = np.nonzero((half_chord_squared > 0.0) & _on_edge(at, edges, growth))
    h, s = height[edge, point], sideways[edge, point]
    ex = normals[edge, 0] * h + along[edge, 0] * s
    ey = normals[edge, 1] * h + along[edge, 1] * s
    qx, qy = qx[point], qy[point]
    angle = np.mod(-turning * np.arctan2(qx * ey - qy * ex, qx * ex + qy * ey), math.tau)
    times = np.full(len(points), np.inf)
    np.minimum.at(times, point, angle / abs(twist.w))
    return times


def _on_edge(at: NDArray[np.float64], edges: Edges, growth: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether positions along the edges (edges, N) lie on them once they are grown."""
    low = edges.low[:, None] - growth * edges.low_stretch[:, None]
    high = edges.high[:, None] + growth * edges.high_stretch[:, None]
    within: NDArray[np.bool_] = (at >= low - 1e-9) & (at <= high + 1e-9)
    return within


def _going_deeper(
    points: Points, twist: Velocity, edges: Edges, nearest_edge: NDArray[np.intp]
) -> NDArray[np.bool_]:
    """Whether the motion takes points that are inside farther in, judged by the edge that each is nearest to."""
    x, y = points.T
    nx, ny = edges.normals[nearest_edge].T
    receding = nx * (twist.w * y - twist.vx) - ny * (twist.vy + twist.w * x)
    deeper: NDArray[np.bool_] = receding < 0.0
    return deeper
