"""``python -m robots.bridge.ros.tap``: the tap of a robot with ROS 1."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from robots.bridge.ros.child_node import joined
from robots.bridge.ros.inspector.definitions import Definitions
from robots.bridge.ros.raw_topic import RawTopic
from robots.bridge.ros.tap.pace import Pace
from robots.bridge.tap.process import run
from robots.bridge.tap.raw_topic import Take
from robots.bridge.tap.source import Listen
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.graph import TAP


def listening(config: BridgeConfig) -> Listen:
    """Return what subscribes to a topic."""
    definitions = Definitions(Path(config.state_dir) / "definitions")

    def listen(topic: str, take: Take, queue: int) -> RawTopic:
        return RawTopic(topic, definitions, take, Pace(), max(queue, Pace.LEAST_QUEUE))

    return listen


if __name__ == "__main__":
    run(listening, partial(joined, TAP))
