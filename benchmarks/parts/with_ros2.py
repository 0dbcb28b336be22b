"""A console with robots of ROS 2, if rclpy is installed."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Coroutine, Sequence
from typing import Any

from benchmarks.harness import Figure, progress
from robots.shared.ros2.environment import READY
from script.stack.stack import PracticeRobot, Stack, temporary_stack


def with_ros2(
    robots: Sequence[PracticeRobot], measure: Callable[[Stack], Coroutine[Any, Any, list[Figure]]]
) -> list[Figure]:
    """Return what `measure` finds on a console with these robots; without rclpy a figure that does not hold."""
    if not READY.exists():
        progress("robots with ROS 2: script/setup ros2 has not installed rclpy; not measured")
        return [Figure("robots with ROS 2", math.nan, "", 0.0)]
    with temporary_stack(robots) as stack:
        return asyncio.run(measure(stack))
