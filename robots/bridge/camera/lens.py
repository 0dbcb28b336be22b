"""The pinhole model of a camera's pictures, from its camera info. Pure.

The page draws the robot's way into the pictures by this model, so a camera info that does not fit the
pictures gives no model. Formulas of the distortion: OpenCV's `calib3d` and `fisheye`, as ROS's
`image_geometry` uses them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Protocol

from robots.shared.sentences import say

MOST_BENT = 0.05  # the largest deviation from the model, as a share of the distance from the middle
_RECTIFIED = re.compile(r"(^|[/_])rect(ified|_color|_raw)?(/|$)")  # topics whose pictures have no distortion
# Shares of the farthest corner's distance: a lens may bend inwards and outwards
_RADII = (0.25, 0.5, 0.75, 1.0)

Lens = tuple[float, float, float, float]  # fx, fy, cx, cy in pixels


class CameraInfo(Protocol):
    """The fields of sensor_msgs/CameraInfo that are used here."""

    width: int
    height: int
    distortion_model: str
    D: Sequence[float]
    K: Sequence[float]
    P: Sequence[float]


class Misfit(ValueError):
    """The camera info does not fit the pictures. The text is the reason."""


def lens_of(info: CameraInfo, width: int, height: int, topic: str) -> Lens:
    """Return the pinhole model of pictures of this size on this topic. Raises `Misfit`."""
    across, along = (width / info.width, height / info.height) if info.width and info.height else (0.0, 1.0)
    if abs(across / along - 1.0) >= 0.02:
        raise Misfit(
            say(
                "its lens is known for {known_width} x {known_height} pixels, not {width} x {height}",
                known_width=info.width,
                known_height=info.height,
                width=width,
                height=height,
            )
        )
    is_rectified = _RECTIFIED.search(topic) is not None
    fx, fy, cx, cy = (
        (info.P[0], info.P[5], info.P[2], info.P[6])
        if is_rectified and info.P[0] > 0.0
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
        raise Misfit(say("the numbers of its camera calibration are not valid"))
    bent = 0.0 if is_rectified else _most_bent(info.distortion_model, info.D, lens, width, height)
    if not bent <= MOST_BENT:
        raise Misfit(say("its lens bends the picture too much: it needs a rectified topic"))
    return lens


def _most_bent(model: str, coefficients: Sequence[float], lens: Lens, width: int, height: int) -> float:
    """Return the largest deviation from the pinhole model, as a share of the distance from the middle.

    Nan if a coefficient is not finite.
    """
    fx, fy, cx, cy = lens
    corner = math.hypot(max(cx, width - cx) / fx, max(cy, height - cy) / fy)
    numbers = [*coefficients, *[0.0] * 8][:8]
    if not all(map(math.isfinite, numbers)):
        return math.nan
    return max(_bent(model, numbers, share * corner) for share in _RADII)


def _bent(model: str, numbers: Sequence[float], radius: float) -> float:
    if model == "equidistant":
        angle = math.atan(radius)
        k1, k2, k3, k4 = numbers[:4]
        seen = angle * (1.0 + k1 * angle**2 + k2 * angle**4 + k3 * angle**6 + k4 * angle**8)
        return abs(seen / radius - 1.0)
    k1, k2, _, _, k3, k4, k5, k6 = numbers  # the two unused ones are tangential, and small
    below = 1.0 + k4 * radius**2 + k5 * radius**4 + k6 * radius**6
    above = 1.0 + k1 * radius**2 + k2 * radius**4 + k3 * radius**6
    return abs(above / below - 1.0) if below else math.inf
