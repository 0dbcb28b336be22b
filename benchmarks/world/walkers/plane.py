"""A plane world of lines and discs: ranges of a laser's beams, and distances to a disc."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
NO_LINES: Floats = np.zeros((0, 4))
NO_DISCS: Floats = np.zeros((0, 3))


class Things(NamedTuple):
    """Lines (x0, y0, x1, y1) and discs (x, y, radius)."""

    lines: Floats = NO_LINES
    discs: Floats = NO_DISCS

    def joined(self, other: Things) -> Things:
        """Return the things of both."""
        return Things(np.concatenate((self.lines, other.lines)), np.concatenate((self.discs, other.discs)))

    def distances(self, places: Floats) -> Floats:
        """Return how far each of `places` (N, 2) is from the nearest thing; negative inside a disc."""
        at = places[:, None]
        start, along = self.lines[:, :2] - at, self.lines[:, 2:] - self.lines[:, :2]
        share = np.clip(-(start * along).sum(2) / (along**2).sum(1), 0.0, 1.0)[..., None]
        lines = np.hypot(*np.moveaxis(start + share * along, 2, 0))
        away = self.discs[:, :2] - at
        discs = np.hypot(away[..., 0], away[..., 1]) - self.discs[:, 2]
        nearest: Floats = np.concatenate((lines, discs), axis=1).min(axis=1)
        return nearest


def box(x: float, y: float, length_m: float, width_m: float, yaw: float) -> Floats:
    """Return the four sides of a box about (x, y), `length_m` along its yaw."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    corners = [
        (x + cos * ahead - sin * left, y + sin * ahead + cos * left)
        for ahead, left in (
            (length_m / 2.0, width_m / 2.0),
            (-length_m / 2.0, width_m / 2.0),
            (-length_m / 2.0, -width_m / 2.0),
            (length_m / 2.0, -width_m / 2.0),
        )
    ]
    return np.array([(*a, *b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)])


class Hits(NamedTuple):
    """Range of each beam (inf: none), and the number of the thing that it hit: lines first, then discs."""

    ranges: Floats
    things: NDArray[np.intp]


def cast(origins: Floats, headings: Floats, things: Things) -> Hits:
    """Return the hits of beams from `origins` (N, 2) along `headings`."""
    cos, sin = np.cos(headings)[:, None], np.sin(headings)[:, None]
    x, y = origins[:, :1], origins[:, 1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        dx, dy = things.lines[:, 0] - x, things.lines[:, 1] - y
        ex, ey = things.lines[:, 2] - things.lines[:, 0], things.lines[:, 3] - things.lines[:, 1]
        cross = cos * ey - sin * ex
        far = (dx * ey - dy * ex) / cross
        at = (dx * sin - dy * cos) / cross
        lines = np.where((far > 0.0) & (at >= 0.0) & (at <= 1.0), far, np.inf)
        dx, dy = things.discs[:, 0] - x, things.discs[:, 1] - y
        ahead, aside = dx * cos + dy * sin, dx * sin - dy * cos
        half = np.sqrt(things.discs[:, 2] ** 2 - aside**2)
        discs = np.where((ahead - half > 0.0), ahead - half, np.inf)
        discs[np.isnan(half)] = np.inf
    every = np.concatenate((lines, discs, np.full((len(headings), 1), np.inf)), axis=1)
    nearest = every.argmin(axis=1)
    return Hits(every[np.arange(len(headings)), nearest], nearest)
