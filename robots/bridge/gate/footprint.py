"""The hull, as a disc or as a convex polygon: gaps, contacts, and what it passes by."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate import arc
from robots.bridge.gate.planar import Points
from robots.bridge.gate.values import GateProfile, Velocity

Metres = NDArray[np.float64]


class Footprint(Protocol):
    """What the gate asks of a hull. Points are (N, 2) in the base frame.

    `demanded_share`: the part of a gap narrower than the margin that must stay free while the robot gets away.
    `corner_stretch`: how much farther than the margin a corner moves out when the hull is grown by it.
    """

    demanded_share: float
    corner_stretch: float

    def reach(self, growth_m: float) -> float:
        """Radius about the base origin that holds the hull grown by `growth_m`."""

    def gaps(self, points: Points) -> Metres:
        """How far each point lies outside the hull; negative inside."""

    def contact_times(self, points: Points, twist: Velocity, growth: Metres) -> NDArray[np.float64]:
        """Seconds until the hull grown by `growth` first touches each point; infinity for never."""

    def path_speeds(self, points: Points, twist: Velocity) -> Metres | float:
        """The speed at which the way to each point is used up, m/s."""

    def clearances(self, points: Points, twist: Velocity) -> Metres:
        """How far each point stays outside of what the hull sweeps on this arc; negative if it is swept."""


class Disc:
    """A disc about the base origin."""

    demanded_share = 1.0  # getting away from anything, a disc need not come nearer to it first
    corner_stretch = 1.0

    def __init__(self, radius_m: float) -> None:
        if not (math.isfinite(radius_m) and radius_m > 0.0):
            raise ValueError("The radius of a footprint must be above zero.")
        self.radius_m = radius_m

    def reach(self, growth_m: float) -> float:
        return self.radius_m + growth_m

    def gaps(self, points: Points) -> Metres:
        x, y = points.T
        gaps: Metres = np.sqrt(x**2 + y**2) - self.radius_m
        return gaps

    def contact_times(self, points: Points, twist: Velocity, growth: Metres) -> NDArray[np.float64]:
        return arc.disc_contact_times(points, twist, self.radius_m + growth)

    def path_speeds(self, points: Points, twist: Velocity) -> float:
        return arc.speed(twist)  # turning a disc brings it no nearer to anything

    def clearances(self, points: Points, twist: Velocity) -> Metres:
        x, y = points.T
        clearances: Metres
        if arc.is_straight(twist):
            clearances = np.abs(twist.vx * y - twist.vy * x) / arc.speed(twist) - self.radius_m
        else:
            cx, cy = arc.centre(twist)
            distance = np.sqrt((x - cx) ** 2 + (y - cy) ** 2)
            clearances = np.abs(distance - math.hypot(cx, cy)) - self.radius_m
        return clearances


class Polygon:
    """A convex outline, counter-clockwise."""

    demanded_share = 0.5  # a corner that turns out of a wall may come a little nearer to it first

    def __init__(self, outline: tuple[tuple[float, float], ...]) -> None:
        self.edges = arc.Edges(outline)
        self.corner_stretch = float(self.edges.corner_stretch.max())
        self._corners = [(float(x), float(y)) for x, y in outline]
        lengths = (self.edges.high - self.edges.low).tolist()
        self._sides = list(zip(self._corners, self.edges.along.tolist(), lengths, strict=True))
        self._corner_distances = np.hypot(*self.edges.vertices.T)

    def reach(self, growth_m: float) -> float:
        return float((self._corner_distances + growth_m * self.edges.corner_stretch).max())

    def gaps(self, points: Points) -> Metres:
        return self.edges.gaps(points)

    def contact_times(self, points: Points, twist: Velocity, growth: Metres) -> NDArray[np.float64]:
        return arc.polygon_contact_times(points, twist, self.edges, growth)

    def path_speeds(self, points: Points, twist: Velocity) -> Metres | float:
        if arc.is_straight(twist):
            return arc.speed(twist)
        cx, cy = arc.centre(twist)
        x, y = points.T
        speeds: Metres = abs(twist.w) * np.sqrt((x - cx) ** 2 + (y - cy) ** 2)
        return np.maximum(speeds, 1e-9)

    def clearances(self, points: Points, twist: Velocity) -> Metres:
        """The hull sweeps a strip, or a ring about the centre of rotation."""
        x, y = points.T
        if arc.is_straight(twist):
            across = np.array([-twist.vy, twist.vx]) / arc.speed(twist)
            corners = self.edges.vertices @ across
            low, high = corners.min(), corners.max()
            where = across[0] * x + across[1] * y
        else:
            cx, cy = arc.centre(twist)
            low, high = self._ring(cx, cy)
            where = np.sqrt((x - cx) ** 2 + (y - cy) ** 2)
        clearances: Metres = np.maximum(where - high, low - where)
        return clearances

    def _ring(self, cx: float, cy: float) -> tuple[float, float]:
        """Nearest and farthest distance of the hull from (cx, cy); 0 nearest if the point is inside.

        Plain numbers: for a handful of corners they are quicker than arrays.
        """
        farthest = max(math.hypot(x - cx, y - cy) for x, y in self._corners)
        nearest, inside = math.inf, True
        for (x, y), (ux, uy), length in self._sides:
            dx, dy = cx - x, cy - y
            along, beyond = ux * dx + uy * dy, uy * dx - ux * dy
            inside = inside and beyond <= 0.0
            nearest = min(nearest, math.hypot(beyond, along - min(max(along, 0.0), length)))
        return 0.0 if inside else nearest, farthest


def footprint_of(profile: GateProfile) -> Footprint:
    """The hull that a profile describes. ValueError if it describes none."""
    if profile.outline is not None:
        return Polygon(profile.outline)
    if profile.radius_m is None:
        raise ValueError("A profile needs a radius or an outline.")
    return Disc(profile.radius_m)
