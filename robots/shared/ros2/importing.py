"""Makes rclpy and the packages of messages importable, behind what the console's own environment has."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from robots.shared.ros2.environment import site_packages


def make_importable() -> None:
    """Add the Python packages of every prefix of `AMENT_PREFIX_PATH` at the end of the path."""
    for prefix in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        folder = str(site_packages(Path(prefix)))
        if folder not in sys.path:  # a distribution's own set-up script has added it
            sys.path.append(folder)
