"""Figures and path of a drive from odometry.

A path has only a few samples. Interpolation between them gives the robot's position at every moment, within a
stated tolerance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from robots.shared.geometry.poses import Pose, Velocity
from robots.shared.records.record_sink import Sample

SAMPLE_S = 0.5
TOLERANCE_M = 0.05
# m: the error is measured this far in front of the robot's middle, so that turns on the spot are kept
LEVER_M = 0.25
MAX_SAMPLES = 600  # limit for a path, however long the drive is


def simplify(samples: Sequence[Sample], tolerance_m: float) -> list[Sample]:
    """Return the samples that the Ramer-Douglas-Peucker algorithm keeps, among them the first and the last.

    Linear motion between kept samples differs from each dropped sample by at most `tolerance_m` at its time.
    Lines are split at the largest error, after Ramer (1972) and Douglas and Peucker (1973). The error is
    measured at equal times, so that speeds and pauses are kept, after Meratnia and de By, "Spatiotemporal
    Compression Techniques for Moving Point Objects" (2004).
    """
    if len(samples) <= 2:
        return list(samples)
    t_s, x, y, yaw, _ = np.array(samples).T
    places = np.column_stack((x, y, LEVER_M * yaw))
    kept = {0, len(samples) - 1}
    lines = [(0, len(samples) - 1)]
    while lines:
        first, last = lines.pop()
        if last - first < 2:
            continue
        share = ((t_s[first:last] - t_s[first]) / (t_s[last] - t_s[first]))[:, None]
        off = places[first:last] - places[first] - share * (places[last] - places[first])
        squares = np.einsum("ij,ij->i", off, off)
        farthest = first + int(np.argmax(squares))
        if squares[farthest - first] > tolerance_m**2:
            kept.add(farthest)
            lines += [(first, farthest), (farthest, last)]
    return [samples[number] for number in sorted(kept)]


class Path:
    """The path of one drive, simplified as it grows. The tolerance is widened when the path becomes too long."""

    def __init__(self, most: int = MAX_SAMPLES) -> None:
        self.samples: list[Sample] = []
        self.tolerance_m = TOLERANCE_M  # upper limit of the error of all added samples
        self._most = most

    def extend(self, fresh: Sequence[Sample]) -> None:
        """Add samples in order of time."""
        settled, joint = self.samples[:-1], self.samples[-1:]
        self.samples = settled + simplify([*joint, *fresh], self.tolerance_m)
        while len(self.samples) > self._most:
            # Another simplification may add the present tolerance to the error again.
            self.samples = simplify(self.samples, self.tolerance_m)
            self.tolerance_m *= 2.0


class Track:
    """Odometry of one drive: distance, top speeds, and samples for the path."""

    def __init__(self, began_s: float) -> None:
        self.distance_m = 0.0
        self.top_mps = 0.0
        self.top_radps = 0.0
        self.fresh: list[Sample] = []  # not in the path yet
        self._began_s = began_s
        self._last: Sample | None = None
        self._sampled = -math.inf  # `t_s` of the newest sample

    def moved(self, pose: Pose, velocity: Velocity, now_s: float) -> None:
        """Take the robot's present position."""
        last, yaw, speed = self._last, pose.yaw, math.hypot(velocity.vx, velocity.vy)
        if last is not None:
            self.distance_m += math.hypot(pose.x - last.x, pose.y - last.y)
            yaw = last.yaw + math.remainder(pose.yaw - last.yaw, math.tau)
        self.top_mps = max(self.top_mps, speed)
        self.top_radps = max(self.top_radps, abs(velocity.w))
        self._last = Sample(now_s - self._began_s, pose.x, pose.y, yaw, speed)
        if self._last.t_s - self._sampled >= SAMPLE_S:
            self._sample(self._last)

    def taken(self, *, last: bool = False) -> list[Sample]:
        """Return and remove the fresh samples. `last`: add the robot's present position."""
        if last and self._last is not None and self._last.t_s > self._sampled:
            self._sample(self._last)
        fresh, self.fresh = self.fresh, []
        return fresh

    def _sample(self, sample: Sample) -> None:
        self._sampled = sample.t_s
        self.fresh.append(sample)
