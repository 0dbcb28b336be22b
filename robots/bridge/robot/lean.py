"""Keeps out of bridge and watchdog what their parts import and they never use: one of each runs for each robot.

All of it is optional to who imports it: without OpenSSL hashlib computes by itself, without bz2 and lzma shutil packs
less, without typing_extensions msgspec asks typing, without ssl there is no TLS, without numpy's new docs its functions
lack their descriptions. What is needed seldom is imported then: websockets reads metadata of packages only in its own
development, rospy YAML only of files and command lines.
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import Any

NUMPYS_DOCS = ("numpy._core._add_newdocs", "numpy._core._add_newdocs_scalars")


def leave_out(*modules: str) -> None:
    """Let imports of these modules raise ImportError. Call this before anything imports them."""
    sys.modules.update(dict.fromkeys(modules))  # type: ignore[arg-type]


def lighten() -> None:
    """Leave out what neither process needs, whichever ROS its robot has. Call this first."""
    leave_out("_hashlib", "bz2", "lzma", "typing_extensions")
    sys.modules |= {name: ModuleType(name) for name in NUMPYS_DOCS}
    sys.modules["yaml"] = Later("yaml")
    sys.modules["importlib.metadata"] = importlib.metadata = Later("importlib.metadata")


class Later(ModuleType):
    """A module that is imported when something of it is asked for."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):  # asked for by the machinery of imports
            raise AttributeError(name)
        if sys.modules.get(self.__name__) is self:
            del sys.modules[self.__name__]
        return getattr(importlib.import_module(self.__name__), name)
