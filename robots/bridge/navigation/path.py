"""The planned path: with fewer points for pages, and the distance that is left."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.gate import BEYOND_REASON
from robots.shared.geometry.planar import NO_POINTS, Points
from robots.shared.geometry.poses import Pose
from robots.shared.wire import MOST_PATH


class PlannedPath:
    """The newest path, in the map frame."""

    def __init__(self) -> None:
        self._points: Points = NO_POINTS
        self._after_m: NDArray[np.float64] = np.empty(0)  # distance along the path from each point to the end

    def take(self, points: Points) -> None:
        """Take a new path. Ignore it if a number is not finite or too large."""
        if not (np.abs(points) < BEYOND_REASON).all():
            return
        if len(points) > MOST_PATH:
            points = points[np.linspace(0, len(points) - 1, MOST_PATH).round().astype(int)]
        self._points = points
        steps = np.hypot(*np.diff(points, axis=0).T) if len(points) > 1 else np.empty(0)
        self._after_m = np.append(np.cumsum(steps[::-1])[::-1], 0.0)[: len(points)]

    def left_m(self, pose: Pose, goal: Pose) -> float:
        """Return the distance left along the path, or in a straight line if there is no path (metres)."""
        straight_m = math.hypot(goal.x - pose.x, goal.y - pose.y)
        if not len(self._points):
            return straight_m
        away = np.hypot(self._points[:, 0] - pose.x, self._points[:, 1] - pose.y)
        nearest = int(away.argmin())
        return max(float(away[nearest] + self._after_m[nearest]), straight_m)

    @property
    def centimetres(self) -> list[int]:
        """The path for pages, in centimetres: x, y, x, y ..."""
        flat: list[int] = np.rint(self._points * 100.0).astype(int).ravel().tolist()
        return flat
