"""The frames of a robot, as its messages on /tf and /tf_static tell them. Pure."""

from __future__ import annotations

import math
from typing import NamedTuple

from msgspec import Struct

from robots.shared.geometry.quaternions import rotation

MOST_FRAMES = 1000
_DEEPEST = 100  # frames between one and the root; more are a loop


class Vector(Struct, frozen=True):
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


class Quaternion(Struct, frozen=True):
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    w: float = 1.0


class Transform(Struct, frozen=True):
    """A pose of one frame in another."""

    translation: Vector = Vector()
    rotation: Quaternion = Quaternion()


class Header(Struct, frozen=True):
    frame_id: str = ""


class Stamped(Struct, frozen=True):
    """A geometry_msgs/TransformStamped, as far as it is read."""

    header: Header
    child_frame_id: str
    transform: Transform


class TfMessage(Struct, frozen=True):
    transforms: list[Stamped]


class Moved(NamedTuple):
    """A difference of two transforms: metres, radians."""

    distance_m: float
    angle_rad: float


class Tree:
    """The newest transform of each frame to its parent."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Transform]] = {}

    def take(self, message: TfMessage) -> None:
        for one in message.transforms:
            child, turned = bare(one.child_frame_id), one.transform.rotation
            turn = rotation(turned.x, turned.y, turned.z, turned.w)
            if turn is not None and (child in self._parents or len(self._parents) < MOST_FRAMES):
                step = Transform(one.transform.translation, Quaternion(*turn))
                self._parents[child] = bare(one.header.frame_id), step

    def find(self, target: str, source: str) -> Transform | None:
        """Return the pose of `source` in `target`; None if they are not connected."""
        of_source, of_target = self._to_root(bare(source)), self._to_root(bare(target))
        common = next((frame for frame in of_source if frame in of_target), None)
        if common is None:
            return None
        return composed(inverse(of_target[common]), of_source[common])

    def _to_root(self, frame: str) -> dict[str, Transform]:
        """Return the pose of a frame in itself, its parent, and so on, in this order."""
        pose = Transform()
        found = {frame: pose}
        while frame in self._parents and len(found) < _DEEPEST:
            frame, step = self._parents[frame]
            pose = composed(step, pose)
            if frame in found:
                break
            found[frame] = pose
        return found


def bare(frame: str) -> str:
    """Return the name of a frame without the slash that older nodes write."""
    return frame.removeprefix("/")


def composed(first: Transform, then: Transform) -> Transform:
    a, b = first.rotation, then.rotation
    moved = _rotated(a, then.translation)
    return Transform(
        Vector(*(getattr(first.translation, axis) + getattr(moved, axis) for axis in "xyz")),
        Quaternion(
            a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
            a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
            a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
            a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
        ),
    )


def inverse(transform: Transform) -> Transform:
    turned = transform.rotation
    back = Quaternion(-turned.x, -turned.y, -turned.z, turned.w)
    moved = _rotated(back, transform.translation)
    return Transform(Vector(-moved.x, -moved.y, -moved.z), back)


def moved(before: Transform, now: Transform) -> Moved:
    step = composed(inverse(before), now)
    at, turned = step.translation, step.rotation
    sine = math.hypot(turned.x, turned.y, turned.z)
    return Moved(math.hypot(at.x, at.y, at.z), 2.0 * math.atan2(sine, abs(turned.w)))


def _rotated(by: Quaternion, vector: Vector) -> Vector:
    # v + 2 u x (u x v + w v), with u the vector part of the quaternion
    cx = by.y * vector.z - by.z * vector.y + by.w * vector.x
    cy = by.z * vector.x - by.x * vector.z + by.w * vector.y
    cz = by.x * vector.y - by.y * vector.x + by.w * vector.z
    return Vector(
        vector.x + 2.0 * (by.y * cz - by.z * cy),
        vector.y + 2.0 * (by.z * cx - by.x * cz),
        vector.z + 2.0 * (by.x * cy - by.y * cx),
    )
