"""Points move with new odometry; nothing is computed again before something has changed."""

from __future__ import annotations

import numpy as np

from robots.bridge.gate.obstacles.obstacle_cache import ObstacleCache
from robots.bridge.gate.timing.trail import Trail
from robots.shared.geometry.poses import STILL, Pose


class Counting:
    """A source with one point, which `move` puts elsewhere."""

    def __init__(self, name, x):
        self.name, self.kind, self.word = name, "scan", name
        self.move(x)

    def move(self, x):
        self._places = np.array([(x, 0.0)])

    def places(self, trail, now_s):
        return self._places

    def moved_nearer(self, points):
        return points


class Doubtful(Counting):
    """A source whose point may be 0.1 m nearer. A point behind the robot does not count."""

    def moved_nearer(self, points):
        return points[points[:, 0] >= 0.0] - (0.1, 0.0)


def test_points_stay_the_same_until_a_source_or_the_pose_changes():
    laser, sonar, trail = Counting("laser", 1.0), Counting("sonar", 2.0), Trail(1.0, 1.0)
    cache = ObstacleCache((laser, sonar), trail)
    first = cache.obstacles(0.0)
    assert cache.obstacles(0.1) is first

    sonar.move(3.0)
    assert cache.obstacles(0.2).points[:, 0].tolist() == [1.0, 3.0]

    trail.add(0.3, Pose(1.0, 0.0, 0.0), STILL)
    again = cache.obstacles(0.3)
    trail.add(0.4, Pose(1.0, 0.0, 0.0), STILL)
    assert cache.obstacles(0.4) is again, "odometry that shows no motion changes nothing"
    assert again.points[:, 0].tolist() == [0.0, 2.0]
    assert [again.names[source] for source in again.source] == ["laser", "sonar"]


def test_a_doubtful_point_comes_nearer_or_goes():
    memory, laser, trail = Doubtful("memory", 1.0), Counting("laser", 2.0), Trail(1.0, 1.0)
    cache = ObstacleCache((memory, laser), trail)
    assert cache.obstacles(0.0).points[:, 0].tolist() == [0.9, 2.0]
    trail.add(0.1, Pose(1.5, 0.0, 0.0), STILL)
    behind = cache.obstacles(0.1)
    assert behind.points[:, 0].tolist() == [0.5]
    assert [behind.names[source] for source in behind.source] == ["laser"]
