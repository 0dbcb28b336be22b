"""All points of the sources at the newest pose, ready before a command needs them.

A source is read again only if the pose or its points changed. So a sonar's reading between two scans costs only its
few points.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robots.bridge.gate.geometry.planar import NO_POINTS, Points, joined
from robots.bridge.gate.motion.corridors import Corridors
from robots.bridge.gate.obstacles.sources import Source
from robots.bridge.gate.timing.trail import Trail
from robots.bridge.gate.values import Obstacles

Revisions = tuple[int, int]  # of the trail, of the source


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
        self._revisions: list[Revisions | None] = [None] * len(sources)
        self._newest: Obstacles | None = None
        self._corridors: Corridors | None = None

    def obstacles(self, now_s: float) -> Obstacles:
        """All points, base frame of the newest odometry."""
        trail_revision = self._trail.revision
        for number, source in enumerate(self._sources):
            revisions = trail_revision, source.revision(now_s)
            if self._revisions[number] != revisions:
                self._revisions[number] = revisions
                self._parts[number] = source.points(self._trail, now_s)
                self._newest = None
        if self._newest is None:
            counts = [len(part) for part in self._parts]
            if counts != self._counts:
                self._counts, self._rows = counts, self._numbers.repeat(counts)
            self._newest = Obstacles(joined(self._parts), self._rows, self._names, self._kinds)
            self._corridors = None
        return self._newest

    def newest(self, now_s: float) -> tuple[Obstacles, Corridors]:
        """Return the same with corridors, which only decisions need."""
        obstacles = self.obstacles(now_s)
        if self._corridors is None:
            self._corridors = Corridors.among(obstacles.points)
        return obstacles, self._corridors
