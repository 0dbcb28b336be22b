"""The movers that one laser follows."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robots.bridge.gate.movers.arrivals import OLDEST_S, Arrivals, Look
from robots.bridge.gate.movers.forecast import may_move
from robots.bridge.gate.movers.tracks import KEPT_S, LOST_S, Track, followed
from robots.bridge.gate.obstacles.sightings import sight
from robots.bridge.gate.sensing.scan import Sweep
from robots.bridge.gate.timing.unseen_motion import Doubt
from robots.shared.geometry.planar import ORIGIN, Points, placed, relative_to
from robots.shared.geometry.poses import Pose

MOVER = "mover"
# If the robot may have moved farther without odometry, standing things seem to have come in a later scan.
CERTAIN_M, CERTAIN_RAD = 0.01, 0.01


class Movers:
    """Moving obstacles by the scans of one laser."""

    def __init__(self) -> None:
        self._arrivals = Arrivals()
        self._tracks: list[Track] = []
        self._waiting: list[Look] = []  # scans that nobody needed yet
        self._frame = 0
        self._newest_s: float | None = None

    @property
    def tracks(self) -> list[Track]:
        """The movers after the newest scan. Scans are compared only while somebody drives."""
        for look in self._waiting:
            self._take(look)
        self._waiting.clear()
        return [track for track in self._tracks if may_move(track)]

    def observe(
        self, points: Callable[[], Points], sweep: Sweep, sensor: Pose, stamp_s: float, frame: int = 0
    ) -> None:
        """Take a scan; `points` in the order of its beams, computed on demand, from a sensor at `sensor`.

        A new `frame` means that the odometry has jumped: earlier observations are then useless.
        """
        if frame != self._frame or (self._newest_s is not None and stamp_s <= self._newest_s):
            self.forget()
            self._frame = frame
        self._newest_s = stamp_s
        self._waiting = [look for look in self._waiting if stamp_s - look.stamp_s <= OLDEST_S]
        self._waiting.append(Look(stamp_s, sensor, sweep, points))

    def forget(self) -> None:
        """Forget all earlier scans."""
        self._forget_scans()
        self._tracks.clear()

    def doubt(self, doubt: Doubt) -> None:
        """Note that the robot's pose may be wrong by this much: later scans must not be compared with earlier ones."""
        if doubt.metres > CERTAIN_M or doubt.radians > CERTAIN_RAD:
            self._forget_scans()

    def _forget_scans(self) -> None:
        self._arrivals.forget()
        self._waiting.clear()

    def _take(self, look: Look) -> None:
        self._tracks = followed(self._tracks, self._arrivals.observe(look), look)
        self._tracks = [
            track for track in self._tracks if look.stamp_s - track.seen_s <= self._patience_s(track, look)
        ]

    def _patience_s(self, track: Track, look: Look) -> float:
        """Return how long a track is kept without arrivals: longer while the scan cannot see its place."""
        if track.seen_s == look.stamp_s:
            return KEPT_S
        place = placed(np.array([(track.x, track.y)]), relative_to(ORIGIN, look.sensor))
        return LOST_S if sight(look.sweep, place).judged[0] else KEPT_S
