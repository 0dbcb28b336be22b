"""The robot as its own reports show it: connection, odometry, battery, health. `Base` is the way back to it."""

from __future__ import annotations

import logging
import math
from typing import Any, Literal, Protocol

from msgspec import Struct

from robots.bridge.audit.records import Records
from robots.bridge.health.battery_time import BatteryTime
from robots.bridge.health.diagnostics import Diagnostics
from robots.bridge.health.health_log import HealthLog
from robots.bridge.tasks.task import Robot
from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.geometry.poses import Pose, Velocity
from robots.shared.sentences import say

log = logging.getLogger(__name__)

ODOMETRY_ONLINE_S = 1.0


class Base(Robot, Protocol):
    """The core's actions on the robot."""

    def publish(self, velocity: Velocity) -> None:
        """Send a twist on the drive topic."""

    def cancel_all(self) -> None:
        """Cancel every goal of every action in `Topics.cancelled`, from any sender."""

    def take_odometry(self) -> None:
        """Handle odometry that has arrived and waits for the event loop."""

    def take_waiting(self) -> None:
        """Handle all messages of sensors that wait since the robot rests."""

    def acknowledged_s(self, now_s: float) -> float | None:
        """Return the time until the robot's computer acknowledged a twist (s); None: no new measurement."""

    def joint(self, name: str) -> float | None:
        """Return the position of a joint (rad or m); None if it was not reported lately."""

    @property
    def listeners(self) -> int:
        """Number of nodes that subscribe to the drive topic."""


class RosStatus(Struct, frozen=True):
    """State of the connection to the robot's ROS, from the monitor of its side."""

    phase: Literal["waiting", "refused", "connecting"]
    text: str
    foreign: list[str] = []  # other nodes that publish to the drive topic
    problems: list[str] = []
    velocities: dict[str, list[str]] = {}  # nodes that publish velocities for the base, by topic


class RobotReports:
    """The robot's latest reports of its own state."""

    def __init__(self, config: BridgeConfig, base: Base, records: Records) -> None:
        self._config = config
        self._base = base
        self.ros = RosStatus("waiting", "The bridge is starting.")
        self.odometry: tuple[float, Pose, Velocity] | None = None  # arrival time, pose and velocity
        self.battery_percent: float | None = None
        self.charging: bool | None = None
        self.skew_s: float | None = None  # robot's clock minus ours, smoothed
        self.diagnostics = Diagnostics()
        self._health_log = HealthLog(self.diagnostics, records)
        self._battery_time = BatteryTime()

    @property
    def is_joined(self) -> bool:
        """Return whether this bridge has joined the robot."""
        return self.ros.phase == "connecting"

    def take_status(self, status: RosStatus) -> None:
        """Take a new state of the ROS connection."""
        if status.phase != self.ros.phase:
            log.info("ROS: %s: %s", status.phase, status.text)
        self.ros = status

    def phase(self, now_s: float) -> tuple[wire.Phase, str]:
        """Return the robot's phase ("online": ready to drive) and what is missing."""
        topics = self._config.topics
        if not self.is_joined:
            return self.ros.phase, self.ros.text
        if self._base.listeners == 0:
            return "connecting", self._problem(
                say("No node on the robot subscribes to {name}.", name=topics.drive.name)
            )
        if self.recent_odometry(now_s) is None:
            return "connecting", self._problem(
                say("No odometry arrives on {name}.", name=topics.odometry.name)
            )
        return "online", self._problem("")

    def _problem(self, otherwise: str) -> str:
        return self.ros.problems[0] if self.ros.problems else otherwise

    def moved(self, pose: Pose, velocity: Velocity, arrival_s: float, skew_s: float) -> None:
        """Take odometry, and the difference of the clocks when it came."""
        self.odometry = (arrival_s, pose, velocity)
        self.skew_s = skew_s if self.skew_s is None else self.skew_s + 0.1 * (skew_s - self.skew_s)

    def recent_odometry(self, now_s: float) -> tuple[float, Pose, Velocity] | None:
        """Return the last odometry; None if it is too old, or never came."""
        odometry = self.odometry
        return odometry if odometry is not None and now_s - odometry[0] <= ODOMETRY_ONLINE_S else None

    def is_silent(self, now_s: float) -> bool:
        """Return whether odometry came, and has stopped: then people must see at once that they look at the past."""
        return self.odometry is not None and now_s - self.odometry[0] > wire.SILENT_S

    def battery(self, percent: float, now_s: float) -> None:
        """Take the battery's charge in percent."""
        if math.isfinite(percent):
            self.battery_percent = min(max(percent, 0.0), 100.0)
            self._battery_time.observe(self.battery_percent, self.charging, now_s)

    def charger(self, charging: bool) -> None:
        """Note whether the robot is on its charger."""
        self.charging = charging

    def state(self, now_s: float) -> dict[str, Any]:
        """Return the fields of `wire.State` that these reports tell."""
        phase, text = self.phase(now_s)
        odometry, unseen_s = None, None
        if self.odometry is not None:
            arrival_s, pose, velocity = self.odometry
            odometry = wire.Odometry(*(round(value, 4) for value in (*pose, *velocity)))
            unseen_s = round(now_s - arrival_s, 1)
        return {
            "phase": phase,
            "text": text,
            "foreign": self.ros.foreign,
            "odometry": odometry,
            "unseen_s": unseen_s,
            "battery_percent": self.battery_percent,
            "charging": self.charging,
            "battery_left_min": self._battery_time.left_min(),
            "health": self.diagnostics.view(now_s),
        }

    def tick(self, now_s: float) -> None:
        """Record changes of the robot's health."""
        self._health_log.tick(self.phase(now_s)[0] == "online", now_s)
