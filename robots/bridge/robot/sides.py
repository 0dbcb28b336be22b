"""The one place that picks the side of ROS that a robot needs.

A process imports one side only: both ROS have packages of the same names.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from robots.shared.configuration.robot_ros import Ros

if TYPE_CHECKING:
    from robots.bridge.robot.interface import RobotSide, StopSide
    from robots.shared.configuration.bridge_config import BridgeConfig
    from robots.shared.configuration.watchdog_config import WatchdogConfig


def lighten(ros: Ros) -> None:
    """Leave out what the side imports and the bridge never uses. Call this before `side`."""
    import_module(f"{ros.side}.lean").lighten()


def lighten_watchdog(ros: Ros) -> None:
    """Leave out what the side imports and a watchdog never uses. Call this before `stop_side`."""
    import_module(f"{ros.side}.lean").lighten_watchdog()


def side(config: BridgeConfig) -> RobotSide:
    """Return the bridge's end of the robot's ROS."""
    base: RobotSide = import_module(f"{config.ros.side}.node").RosBase(config)
    return base


def stop_side(config: WatchdogConfig) -> StopSide:
    """Return the watchdog's end of the robot's ROS."""
    node: StopSide = import_module(f"{config.ros.side}.watchdog").WatchdogNode(config)
    return node
