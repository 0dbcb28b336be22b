"""Lets rclpy have what both ROS sides would leave out, and nothing else: rclpy needs most of what it imports."""

from __future__ import annotations

import sys


def lighten() -> None:
    """Let rclpy import typing_extensions. Call this before anything imports rclpy."""
    if sys.modules.get("typing_extensions", ...) is None:
        del sys.modules["typing_extensions"]


def lighten_watchdog() -> None:
    """Do the same in a watchdog."""
    lighten()
