"""Velocities in the words of a geometry_msgs/Twist: from fields, nested or with dotted keys. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from robots.bridge.gate.values import Velocity
from robots.wire import Refusal

TYPES = ("geometry_msgs/Twist", "geometry_msgs/TwistStamped")
_AXES = ("linear.x", "linear.y", "linear.z", "angular.x", "angular.y", "angular.z")
_PLANAR = ("linear.x", "linear.y", "angular.z")


def velocity_from(fields: Mapping[str, Any], type_name: str) -> Velocity | Refusal:
    """The planar velocity (m/s, rad/s), or the first field that is none of a base's."""
    prefix = "twist." if type_name == TYPES[1] else ""
    speeds = dict.fromkeys(_AXES, 0.0)
    for path, value in _flat(fields):
        axis = path.removeprefix(prefix)
        if prefix and path.startswith("header."):
            continue
        if not path.startswith(prefix) or axis not in speeds:
            return _bad(path, f"{type_name} has no field {path}.")
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            return _bad(path, f"{path} is not a number.")
        if value and axis not in _PLANAR:
            return _bad(path, f"{path} must be 0: the base moves in the plane.")
        speeds[axis] = float(value)
    return Velocity(*(speeds[axis] for axis in _PLANAR))


def _flat(fields: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in fields.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield prefix + name, value


def _bad(path: str, text: str) -> Refusal:
    return Refusal("bad_field", text, "wire", {"path": path})
