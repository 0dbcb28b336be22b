"""``python -m robots.bridge.ros.camera``: the camera process of a robot with ROS 1."""

from __future__ import annotations

from functools import partial

from robots.bridge.camera.process import run
from robots.bridge.ros.camera.camera_topics import CameraTopics
from robots.bridge.ros.child_node import joined
from robots.shared.graph import CAMERA

if __name__ == "__main__":
    run(CameraTopics, partial(joined, CAMERA))
