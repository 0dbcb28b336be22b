"""Keeps out of bridge and watchdog what their parts import and they never use: one of each runs for each robot.

All of it is optional to who imports it: without OpenSSL hashlib computes by itself, without bz2 and lzma shutil packs
less, without typing_extensions msgspec asks typing, without ssl there is no TLS.
"""

from __future__ import annotations

import sys


def leave_out(*modules: str) -> None:
    """Let imports of these modules raise ImportError. Call this before anything imports them."""
    sys.modules.update(dict.fromkeys(modules))  # type: ignore[arg-type]


def lighten() -> None:
    """Leave out what neither process needs, whichever ROS its robot has. Call this first."""
    leave_out("_hashlib", "bz2", "lzma", "typing_extensions")
