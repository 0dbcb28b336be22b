"""The lens of a camera: a pinhole without distortion, with the optical axis in the middle of the picture."""

from __future__ import annotations

from typing import NamedTuple

from robots.simulator.sensors.depth import FOCAL_PX, HEIGHT, WIDTH


class Lens(NamedTuple):
    """Size of the picture and focal length, in pixels."""

    width: int
    height: int
    focal_px: float


HEAD_LENS = Lens(WIDTH, HEIGHT, FOCAL_PX)  # of the colour and the depth camera, as on the robot
REAR_LENS = Lens(320, 240, 170.0)  # 87 degrees wide
