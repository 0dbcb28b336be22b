"""The planned path: thinned for pages, and how much of it is left."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.gate import BEYOND_REASON
from robots.bridge.gate.geometry.planar import NO_POINTS, Points
from robots.bridge.gate.values import Pose
from robots.wire import MOST_PATH


class PlannedPath:
    """The newest path, frame of the map."""

    def __init__(self) -> None:
        self._places: Points = NO_POINTS
        self._after_m: NDArray[np.float64] = np.empty(0)  # way from each place to the end

    def take(self, places: Points) -> None:
        """Take a new path; one with numbers beyond reason is ignored."""
        if not (np.abs(places) < BEYOND_REASON).all():
            return
        if len(places) > MOST_PATH:
            places = places[np.linspace(0, len(places) - 1, MOST_PATH).round().astype(int)]
        self._places = places
        steps = np.hypot(*np.diff(places, axis=0).T) if len(places) > 1 else np.empty(0)
        self._after_m = np.append(np.cumsum(steps[::-1])[::-1], 0.0)[: len(places)]

    def left_m(self, pose: Pose, goal: Pose) -> float:
        """Return the way that is left along the path; the straight distance if there is no path to this goal."""
        straight_m = math.hypot(goal.x - pose.x, goal.y - pose.y)
        if not len(self._places):
            return straight_m
        away = np.hypot(self._places[:, 0] - pose.x, self._places[:, 1] - pose.y)
        nearest = int(away.argmin())
        return max(float(away[nearest] + self._after_m[nearest]), straight_m)

    @property
    def centimetres(self) -> list[int]:
        """The path for pages: flat x, y."""
        flat: list[int] = np.rint(self._places * 100.0).astype(int).ravel().tolist()
        return flat
