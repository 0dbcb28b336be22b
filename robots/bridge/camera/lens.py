"""The pinhole of a camera's pictures, from its camera info. Pure.

People see the robot's way drawn by this pinhole, so an info that does not fit the pictures gives none. Formulas of the
distortion: OpenCV's `calib3d` and `fisheye`, as ROS's `image_geometry` uses them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

MOST_BENT = 0.05  # of the distance from the middle: by more, a corner must not differ from the pinhole's
_RECTIFIED = "rect"  # in names of topics whose pictures have no distortion (image_rect, image_rect_color)

Lens = tuple[float, float, float, float]  # fx, fy, cx, cy in pixels


class CameraInfo(Protocol):
    """The fields of sensor_msgs/CameraInfo that count here."""

    width: int
    height: int
    distortion_model: str
    D: Sequence[float]
    K: Sequence[float]
    P: Sequence[float]


class Misfit(ValueError):
    """The camera info does not fit the pictures. The text is the reason, for staff."""


def lens_of(info: CameraInfo, width: int, height: int, topic: str) -> Lens:
    """Return the pinhole of pictures of this size on this topic. Raises `Misfit`."""
    across, along = (width / info.width, height / info.height) if info.width and info.height else (0.0, 1.0)
    if abs(across / along - 1.0) >= 0.02:
        raise Misfit(f"it is of pictures of {info.width} x {info.height}, not {width} x {height}")
    is_rectified = _RECTIFIED in topic and info.P[0] > 0.0
    fx, fy, cx, cy = (
        (info.P[0], info.P[5], info.P[2], info.P[6])
        if is_rectified
        else (info.K[0], info.K[4], info.K[2], info.K[5])
    )
    lens = (fx * across, fy * along, cx * across, cy * along)
    plausible = (
        0.1 * width < lens[0] < 20.0 * width
        and 0.1 * height < lens[1] < 20.0 * height
        and 0.0 <= lens[2] <= width
        and 0.0 <= lens[3] <= height
    )
    if not plausible:
        raise Misfit("its focal length or its middle makes no sense")
    if not is_rectified and (bent := _bent(info.distortion_model, info.D, lens, width, height)) > MOST_BENT:
        raise Misfit(f"the lens bends its pictures by {bent:.0%}: choose a rectified topic")
    return lens


def _bent(model: str, coefficients: Sequence[float], lens: Lens, width: int, height: int) -> float:
    """Return by what share the farthest corner is nearer to the middle, or farther, than a pinhole shows it."""
    fx, fy, cx, cy = lens
    radius = math.hypot(max(cx, width - cx) / fx, max(cy, height - cy) / fy)
    numbers = [*coefficients, *[0.0] * 8][:8]
    if not all(map(math.isfinite, numbers)):
        return math.inf
    if model == "equidistant":
        angle = math.atan(radius)
        k1, k2, k3, k4 = numbers[:4]
        seen = angle * (1.0 + k1 * angle**2 + k2 * angle**4 + k3 * angle**6 + k4 * angle**8)
        return abs(seen / radius - 1.0)
    k1, k2, _, _, k3, k4, k5, k6 = numbers  # between them the tangential ones, which are small
    below = 1.0 + k4 * radius**2 + k5 * radius**4 + k6 * radius**6
    above = 1.0 + k1 * radius**2 + k2 * radius**4 + k3 * radius**6
    return abs(above / below - 1.0) if below else math.inf
