"""Configuration of a watchdog: a small part of the bridge's configuration."""

from __future__ import annotations

import hashlib
from pathlib import Path
from uuid import UUID

import msgspec
from msgspec import Struct

from robots.shared.configuration.bridge_config import BridgeConfig, Topic
from robots.shared.configuration.robot_ros import Ros
from robots.shared.processes.probe_findings import watchdog_name


class WatchdogConfig(Struct, frozen=True):
    """The whole configuration of one watchdog."""

    robot_id: UUID
    slug: str
    ros: Ros
    node: str  # its node name
    drive: Topic
    actions: tuple[str, ...]  # names of actions whose goals are cancelled while a stop is latched
    lane: str  # path of its socket
    state_dir: str

    def digest(self) -> str:
        """Return a hash of the configuration: it differs when any setting differs."""
        return hashlib.sha256(msgspec.json.encode(self)).hexdigest()


def lane_path(config: BridgeConfig) -> str:
    """Return the path of the watchdog's socket: next to the bridge's socket, or in the state directory."""
    if config.link.unix_path:
        return str(Path(config.link.unix_path).with_suffix(".stop"))
    return str(Path(config.state_dir) / f"{UUID(config.robot_id).hex[:12]}.stop")


def watchdog_config(config: BridgeConfig) -> WatchdogConfig:
    """Return the watchdog's part of a bridge's configuration."""
    topics = config.topics
    actions = {*topics.cancelled}
    actions |= {topic.name for topic in (topics.motions, topics.speech) if topic and topic.is_action}
    if topics.motions:
        actions |= {one.name for one in config.allowed if one.what == "choose" and one.use == "motions"}
    return WatchdogConfig(
        robot_id=UUID(config.robot_id),
        slug=config.slug,
        ros=config.ros,
        node=watchdog_name(config.robot_id),
        drive=topics.drive,
        actions=tuple(sorted(actions)),
        lane=lane_path(config),
        state_dir=config.state_dir,
    )
