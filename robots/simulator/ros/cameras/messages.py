"""Messages that colour and depth cameras have in common."""

from __future__ import annotations

import rospy
from sensor_msgs.msg import CameraInfo

from robots.simulator.cameras.lens import Lens


def camera_info(lens: Lens) -> CameraInfo:
    """Return the camera info of a pinhole without distortion."""
    focal, cx, cy = lens.focal_px, lens.width / 2.0, lens.height / 2.0
    message = CameraInfo(height=lens.height, width=lens.width, distortion_model="plumb_bob", D=[0.0] * 5)
    message.K = [focal, 0.0, cx, 0.0, focal, cy, 0.0, 0.0, 1.0]
    message.R = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    message.P = [focal, 0.0, cx, 0.0, 0.0, focal, cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    return message


def anybody(*publishers: rospy.Publisher) -> bool:
    """Return whether one of these topics has a subscriber."""
    return any(publisher.get_num_connections() for publisher in publishers)
