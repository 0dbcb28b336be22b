"""Messages that colour and depth cameras have in common."""

from __future__ import annotations

from typing import Any

from robots.simulator.cameras.lens import Lens
from robots.simulator.ros_side import Publisher, RosSide


def camera_info(ros: RosSide, lens: Lens) -> Any:
    """Return the camera info of a pinhole without distortion."""
    focal, cx, cy = lens.focal_px, lens.width / 2.0, lens.height / 2.0
    message = ros.new(
        "sensor_msgs/CameraInfo", height=lens.height, width=lens.width, distortion_model="plumb_bob"
    )
    return ros.calibrated(
        message,
        d=[0.0] * 5,
        k=[focal, 0.0, cx, 0.0, focal, cy, 0.0, 0.0, 1.0],
        r=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p=[focal, 0.0, cx, 0.0, 0.0, focal, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    )


def anybody(*publishers: Publisher) -> bool:
    """Return whether one of these topics has a subscriber."""
    return any(publisher.wanted for publisher in publishers)
