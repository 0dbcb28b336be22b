"""The parts of ROS that bridge and simulator share. This package makes the distribution's ROS importable.

ROS 1 is installed in the distribution's package folder, which a virtual environment does not include. A finder
at the end of the import system searches that folder, so that Python takes from it only packages that the environment
lacks. Only processes that use ROS have the finder, so the web process cannot import from the folder.
`FLEET_ROS_PATH` names other folders (separated by colons), such as ``/opt/ros/noetic/lib/python3/dist-packages``.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType

DISTRIBUTION = "/usr/lib/python3/dist-packages"


class LastFinder:
    """Finds top-level packages in folders, after all other finders.

    `sys.path` cannot do this: a package with ``__init__.py`` in its last folder wins over a namespace package (without
    that file) in its first. Debian's ``zope`` is such a package, the environment's ``zope`` such a namespace.
    """

    def __init__(self, folders: Sequence[str]) -> None:
        self.folders = list(folders)

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return the place of a top-level package; None if no folder has it. A package finds its own parts."""
        return PathFinder.find_spec(name, self.folders, target) if path is None else None


def ros_folders() -> list[str]:
    """Return the folders that contain rospy."""
    return [folder for folder in os.environ.get("FLEET_ROS_PATH", DISTRIBUTION).split(":") if folder]


last_finder = LastFinder(ros_folders())
sys.meta_path.append(last_finder)
