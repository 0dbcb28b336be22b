"""The bridge's ROS side. Only this package imports rospy; it makes the distribution's ROS importable.

ROS 1 is installed in the distribution's package folder, which a virtual environment does not include. The
folder is appended at the end of the path, so that Python finds the environment's own packages first. Only
processes that use ROS append it, so the web process cannot import from it. `FLEET_ROS_PATH` names other
folders (separated by colons), such as ``/opt/ros/noetic/lib/python3/dist-packages``.
"""

from __future__ import annotations

import os
import sys

DISTRIBUTION = "/usr/lib/python3/dist-packages"


def ros_folders() -> list[str]:
    """Return the folders that contain rospy."""
    return [folder for folder in os.environ.get("FLEET_ROS_PATH", DISTRIBUTION).split(":") if folder]


def append_ros_folders() -> None:
    """Append each folder once."""
    sys.path.extend(folder for folder in ros_folders() if folder not in sys.path)


append_ros_folders()
