"""Computes a frame's pose in the base frame at a stamp, from the transforms of /tf and /tf_static.

A robot publishes thirty frames fifty times a second. The chain from the base to one camera is needed ten times a
second, and numbers are unpacked only then. Transforms are kept packed, by child frame.
"""

from __future__ import annotations

import math
import struct
import threading
import time
from bisect import bisect_left
from collections import OrderedDict, deque
from collections.abc import Iterable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.shared.geometry.poses import Pose
from robots.shared.geometry.quaternions import LEAST, rotation
from robots.shared.sentences import say
from robots.shared.texts import NAME

MAP, ODOM = "map", "odom"  # frames by their usual names (REP 105)
KEPT = 100  # transforms of each frame: 2 s at 50 Hz
PATIENCE_S = 0.15  # longest wait of a picture for the transforms of its stamp
LARGEST_HOLE_S = 0.3  # between two transforms that are interpolated
SET_BACK_S = 1.0
# during faster turns, a small error of a stamp would make the floor look like an obstacle
TURNING_RADPS = 0.5
LONGEST_WAY = 30
MOST_MOVING = 500  # frames in memory; a robot publishes about fifty
MOST_FIXED = 2000
MOST_WANTED = 200  # requested frames, which are never dropped for others
FULL_S = 15.0  # how long the page shows that frames were dropped

TRANSFORM = struct.Struct("<7d")  # of a packed pose: translation, rotation (x, y, z, w)

Matrix = NDArray[np.float64]  # (4, 4)


class PoseUnknown(Exception):
    """The frames do not give a pose. The text is the reason; it follows "depth camera:"."""


class FramePose(NamedTuple):
    """A child frame's pose in its parent, not unpacked yet."""

    stamp_s: float
    parent: str
    packed: bytes


class Frames:
    """The newest transforms of every frame. `take` and `pose_at` may be called on different threads."""

    def __init__(self, base: str) -> None:
        self._base = base
        self._fixed: dict[str, FramePose] = {}
        self._moving: OrderedDict[str, deque[FramePose]] = OrderedDict()  # most recently updated at the end
        self._wanted: set[str] = set()  # frames on the chain of a requested frame
        self._full_s = -math.inf  # when a frame was dropped last
        self._news = threading.Condition()

    @property
    def is_full(self) -> bool:
        """Return whether frames were dropped lately because there are too many."""
        return time.monotonic() - self._full_s < FULL_S

    def take(self, transforms: Iterable[tuple[str, FramePose]], fixed: bool) -> None:
        """Take poses of child frames, as one message has them."""
        with self._news:
            for child, pose in transforms:
                if len(child) > NAME or len(pose.parent) > NAME:
                    continue
                if fixed:
                    self._fix(child, pose)
                    continue
                history = self._history(child)
                if history is None:
                    continue
                if history and pose.stamp_s <= history[-1].stamp_s:
                    if pose.stamp_s > history[-1].stamp_s - SET_BACK_S:
                        continue
                    history.clear()
                history.append(pose)
            self._news.notify_all()

    def _fix(self, child: str, pose: FramePose) -> None:
        """Keep a static transform. It is published once, so when the table is full the first ones stay."""
        if child in self._fixed or child in self._wanted or len(self._fixed) < MOST_FIXED:
            self._fixed[child] = pose
        else:
            self._full_s = time.monotonic()

    def _history(self, child: str) -> deque[FramePose] | None:
        """Return the history of a moving frame. If there are too many, the oldest unneeded one is dropped."""
        if child not in self._moving:
            if len(self._moving) >= MOST_MOVING:
                self._full_s = time.monotonic()
                oldest = next((frame for frame in self._moving if frame not in self._wanted), None)
                if oldest is None:
                    return None
                del self._moving[oldest]
            self._moving[child] = deque(maxlen=KEPT)
        self._moving.move_to_end(child)
        return self._moving[child]

    def forget(self) -> None:
        """Forget all earlier transforms."""
        with self._news:
            self._fixed.clear()
            self._moving.clear()

    def pose_at(
        self, frame: str, stamp_s: float, patience_s: float = PATIENCE_S, late_s: float = 0.0
    ) -> Matrix:
        """Return the transform from `frame` to the base at a stamp. Waits for late transforms. Raises PoseUnknown.

        The newest transforms are used if they are at most `late_s` older than the stamp.
        """
        deadline_s = time.monotonic() + patience_s
        with self._news:
            while (left_s := deadline_s - time.monotonic()) > 0.0 and self._to_come(frame, stamp_s):
                self._news.wait(left_s)
            matrix = np.eye(4)
            for child in self._way(frame):
                matrix = self._at(child, stamp_s, late_s) @ matrix
            return matrix

    def flat(self, frame: str, parent: str) -> tuple[float, Pose] | None:
        """Return stamp and newest known pose of a frame in its parent, seen from above; None if unknown."""
        with self._news:
            self._want(frame)
            pose = self._newest(frame)
        if pose is None or pose.parent != parent:
            return None
        try:
            matrix = _matrix(*_parts(pose.packed))
        except PoseUnknown:
            return None
        yaw = math.atan2(float(matrix[1, 0]), float(matrix[0, 0]))
        return pose.stamp_s, Pose(float(matrix[0, 3]), float(matrix[1, 3]), yaw)

    def _to_come(self, frame: str, stamp_s: float) -> bool:
        try:
            way = self._way(frame)
        except PoseUnknown:
            return True
        return any(child not in self._fixed and self._moving[child][-1].stamp_s < stamp_s for child in way)

    def _way(self, frame: str) -> list[str]:
        """Return the frames on the chain from `frame` to the base, without the base."""
        way: list[str] = []
        while frame != self._base:
            self._want(frame)
            pose = self._newest(frame)
            if pose is None or len(way) == LONGEST_WAY:
                raise PoseUnknown(say("tf has no pose of {frame} on {base}", frame=frame, base=self._base))
            way.append(frame)
            frame = pose.parent
        return way

    def _want(self, frame: str) -> None:
        """Keep this frame even when the table is full. With too many requests, all earlier ones are forgotten."""
        if frame not in self._wanted:
            if len(self._wanted) >= MOST_WANTED:
                self._wanted.clear()
            self._wanted.add(frame)

    def _newest(self, child: str) -> FramePose | None:
        if child in self._fixed:
            return self._fixed[child]
        return self._moving[child][-1] if child in self._moving else None

    def _at(self, child: str, stamp_s: float, late_s: float) -> Matrix:
        """Return the transform of one frame to its parent at a stamp."""
        if child in self._fixed:
            return _cached_matrix(self._fixed[child].packed)
        history = self._moving[child]
        later = bisect_left(history, stamp_s, key=lambda pose: pose.stamp_s)
        if later == len(history):
            if stamp_s - history[-1].stamp_s > late_s:
                raise PoseUnknown(say("tf’s pose of {frame} came too late", frame=child))
            later, stamp_s = later - 1, history[-1].stamp_s
        if later > 0:
            return _between(child, history[later - 1], history[later], stamp_s)
        if history[0].stamp_s > stamp_s:
            raise PoseUnknown(say("tf has no pose of {frame} for that time", frame=child))
        return _matrix(*_parts(history[0].packed))


def _parts(packed: bytes) -> tuple[Matrix, Matrix]:
    """Unpack translation and unit quaternion. Raises PoseUnknown for implausible numbers.

    A quaternion that is zero or nearly so is refused, as tf2 does: by a camera in a wrong direction, obstacles would
    be elsewhere.
    """
    *translation, x, y, z, w = TRANSFORM.unpack(packed)
    turn = rotation(x, y, z, w)
    if turn is None or math.hypot(x, y, z, w) < LEAST or not all(map(math.isfinite, translation)):
        raise PoseUnknown(say("tf has invalid numbers"))
    return np.array(translation), np.array(turn)


@lru_cache(MOST_WANTED)
def _cached_matrix(packed: bytes) -> Matrix:
    return _matrix(*_parts(packed))


def _between(child: str, before: FramePose, after: FramePose, stamp_s: float) -> Matrix:
    hole_s = after.stamp_s - before.stamp_s
    if hole_s > LARGEST_HOLE_S:
        raise PoseUnknown(say("tf had no pose of {frame} for {seconds:.1f} s", frame=child, seconds=hole_s))
    if before.packed == after.packed:  # the frame rests
        return _cached_matrix(after.packed)
    (start, first), (end, second) = _parts(before.packed), _parts(after.packed)
    if first @ second < 0.0:
        second = -second
    if 2.0 * math.acos(min(float(first @ second), 1.0)) > TURNING_RADPS * hole_s:
        raise PoseUnknown(say("the head is turning"))
    share = (stamp_s - before.stamp_s) / hole_s
    turn = first + share * (second - first)
    return _matrix(start + share * (end - start), turn / math.sqrt(float(turn @ turn)))


def _matrix(translation: Matrix, turn: Matrix) -> Matrix:
    x, y, z, w = turn.tolist()
    matrix = np.eye(4)
    matrix[:3, :3] = (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)),
        (2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)),
        (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)),
    )
    matrix[:3, 3] = translation
    return matrix
