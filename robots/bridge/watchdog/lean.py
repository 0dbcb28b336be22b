"""Keeps out of the watchdog what rospy and its parts import and the watchdog never uses: half of its memory.

All four are optional to who imports them: without numpy genpy knows no numpy numbers, without ssl there is no https,
without OpenSSL hashlib computes by itself, and of roslib rospy asks only whether a shell uses it, which it is told.
"""

from __future__ import annotations

import sys
from types import ModuleType

MISSING = ("numpy", "ssl", "_hashlib")


def leave_out() -> None:
    """Call this before anything imports them."""
    sys.modules.update(dict.fromkeys(MISSING))  # type: ignore[arg-type]  # None: an import raises ImportError
    sys.modules["roslib"] = ModuleType("roslib")
