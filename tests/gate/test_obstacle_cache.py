"""Points move with new odometry, and each source is read only if it has changed."""

from __future__ import annotations

import numpy as np

from robots.bridge.gate.obstacles.obstacle_cache import ObstacleCache
from robots.bridge.gate.timing.trail import Trail
from robots.bridge.gate.values import STILL, Pose


class Counting:
    """A source with one point that counts its readings."""

    def __init__(self, name, x):
        self.name, self.kind, self.word = name, "scan", name
        self.x, self.changes, self.asked = x, 0, 0

    def revision(self, now_s):
        return self.changes

    def points(self, trail, now_s):
        self.asked += 1
        return np.array([(self.x, 0.0)])


def test_one_new_reading_leaves_other_sources_a_pose_asks_all():
    laser, sonar, trail = Counting("laser", 1.0), Counting("sonar", 2.0), Trail(1.0, 1.0)
    cache = ObstacleCache((laser, sonar), trail)
    first = cache.obstacles(0.0)
    assert cache.obstacles(0.1) is first

    sonar.x, sonar.changes = 3.0, 1
    assert cache.obstacles(0.2).points[:, 0].tolist() == [1.0, 3.0]
    assert (laser.asked, sonar.asked) == (1, 2)

    trail.add(0.3, Pose(1.0, 0.0, 0.0), STILL)
    again = cache.obstacles(0.3)
    assert (laser.asked, sonar.asked) == (2, 3)
    assert [again.names[source] for source in again.source] == ["laser", "sonar"]
