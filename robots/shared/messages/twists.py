"""Planar velocities from the fields of a geometry_msgs/Twist, nested or with dotted keys. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robots.shared.geometry.poses import Velocity
from robots.shared.messages.fields import BadField, fit_fields
from robots.shared.messages.type_names import bare
from robots.shared.sentences import say
from robots.shared.wire import Field, Refusal

_VECTOR = [Field(axis, "float64") for axis in "xyz"]
_TWIST = [Field(part, "geometry_msgs/Vector3", fields=_VECTOR) for part in ("linear", "angular")]
_HEADER = [Field("seq", "uint32"), Field("stamp", "time"), Field("frame_id", "string")]
_STAMPED = [
    Field("header", "std_msgs/Header", fields=_HEADER),
    Field("twist", "geometry_msgs/Twist", fields=_TWIST),
]
_DEFINITIONS = {"geometry_msgs/Twist": _TWIST, "geometry_msgs/TwistStamped": _STAMPED}
_PLANAR = (("linear", "x"), ("linear", "y"), ("angular", "z"))

TYPES = tuple(_DEFINITIONS)


def velocity_from(fields: Mapping[str, Any], type_name: str) -> Velocity | Refusal:
    """Return the planar velocity (m/s, rad/s), or a refusal of the first field that a base cannot follow."""
    try:
        given = fit_fields(_DEFINITIONS[bare(type_name)], fields)
    except BadField as error:
        return error.refusal
    twist, prefix = (given, "") if bare(type_name) == TYPES[0] else (given.get("twist", {}), "twist.")
    for part, vector in twist.items():
        for axis, speed in vector.items():
            if speed and (part, axis) not in _PLANAR:
                path = f"{prefix}{part}.{axis}"
                text = say("{path} must be 0: the base moves in the plane.", path=path)
                return Refusal("bad_field", text, "wire", {"path": path})
    return Velocity(*(twist.get(part, {}).get(axis, 0.0) for part, axis in _PLANAR))
