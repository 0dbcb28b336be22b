"""All points of the sources at the newest pose, ready before a command needs them.

Sources keep their points in the odometry frame. So a new pose needs only one transformation of all points,
and a sonar's reading between two scans costs only its few points.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robots.bridge.gate.motion.corridors import Corridors
from robots.bridge.gate.obstacles.sources import Source
from robots.bridge.gate.timing.trail import Trail
from robots.bridge.gate.values import Obstacles
from robots.shared.geometry.planar import NO_POINTS, ORIGIN, Points, joined, placed, relative_to
from robots.shared.geometry.poses import Pose


class ObstacleCache:
    """The points of one robot's sources, in the order of the sources."""

    def __init__(self, sources: Sequence[Source], trail: Trail) -> None:
        self._sources = sources
        self._trail = trail
        self._names = tuple(source.name for source in sources)
        self._kinds = tuple(source.kind for source in sources)
        self._parts: list[Points] = [NO_POINTS] * len(sources)
        self._numbers = np.arange(len(sources))
        self._counts: list[int] = []
        self._rows = self._numbers[:0]  # the source of each point
        self._places = NO_POINTS  # the points of all sources, odometry frame
        self._base = ORIGIN  # of `_newest`
        self._newest: Obstacles | None = None
        self._corridors: Corridors | None = None
        self._met: list[int] = []  # rows of the last corridors that were in a box

    def obstacles(self, now_s: float) -> Obstacles:
        """Return all points, base frame of the newest odometry."""
        parts = [source.places(self._trail, now_s) for source in self._sources]
        if any(part is not known for part, known in zip(parts, self._parts, strict=True)):
            self._parts, self._newest = parts, None
            self._places = joined(parts)
            counts = [len(part) for part in parts]
            if counts != self._counts:
                self._counts, self._rows = counts, self._numbers.repeat(counts)
        base = self._trail.newest or ORIGIN
        if self._newest is None or base != self._base:
            if self._corridors is not None:
                self._met = self._corridors.met
            self._base, self._newest, self._corridors = base, self._at(base), None
        return self._newest

    def newest(self, now_s: float) -> tuple[Obstacles, Corridors]:
        """Return the same points with their corridors, which only decisions need."""
        obstacles = self.obstacles(now_s)
        if self._corridors is None:
            self._corridors = Corridors(obstacles.points, self._met)
        return obstacles, self._corridors

    def as_seen(self, now_s: float) -> Obstacles:
        """Return all points at their measured places, base frame of the newest odometry."""
        parts = [source.as_seen(self._trail, now_s) for source in self._sources]
        points = placed(joined(parts), relative_to(ORIGIN, self._trail.newest or ORIGIN))
        return Obstacles(
            points, self._numbers.repeat([len(part) for part in parts]), self._names, self._kinds
        )

    def _at(self, base: Pose) -> Obstacles:
        points, rows = placed(self._places, relative_to(ORIGIN, base)), self._rows
        begin, parts, fits = 0, [], True
        for source, places in zip(self._sources, self._parts, strict=True):
            count = len(places)
            part = points[begin : begin + count]
            if count:
                nearer = source.moved_nearer(part)
                if nearer is not part and len(nearer) == count:
                    part[...] = nearer
                elif nearer is not part:
                    part, fits = nearer, False
            parts.append(part)
            begin += count
        if not fits:
            points, rows = joined(parts), self._numbers.repeat([len(part) for part in parts])
        return Obstacles(points, rows, self._names, self._kinds)
