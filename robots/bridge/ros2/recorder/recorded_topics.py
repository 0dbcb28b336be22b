"""The topics of a robot, for the recorder."""

from __future__ import annotations

from collections.abc import Callable

from robots.bridge.ros2.inspector import graph
from robots.bridge.ros2.raw_topic import RawTopic, RawTopics
from robots.bridge.tap.raw_topic import Take
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.graph import RECORDER, SystemState

QUEUE = 100  # messages of a topic that wait for the executor


class RecordedTopics:
    """The topics of the domain that this process has joined."""

    encoding = "cdr"

    def __init__(self, config: BridgeConfig) -> None:
        self._topics = RawTopics(config, RECORDER)

    def listen(self, topic: str, take: Take, *, thins: bool) -> RawTopic:
        return self._topics.listen(topic, take, 1 if thins else QUEUE)

    def survey(self) -> SystemState:
        return graph.published(self._topics.participant.node)

    def leave(self) -> None:
        self._topics.leave()


def joined(config: BridgeConfig, at_end: Callable[[], object]) -> RecordedTopics:
    """Join the robot's domain, which no robot's death ends: `at_end` is never called."""
    return RecordedTopics(config)
