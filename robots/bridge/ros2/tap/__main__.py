"""``python -m robots.bridge.ros2.tap``: the tap of a robot with ROS 2."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from robots.bridge.ros2.raw_topic import RawTopic, RawTopics
from robots.bridge.tap.process import run
from robots.bridge.tap.raw_topic import Take
from robots.bridge.tap.source import Listen
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.graph import TAP

LEAST_QUEUE = 4  # messages of a topic that wait for the executor


class Domain:
    """The robot's domain, as long as the process runs."""

    @contextmanager
    def joined(self, config: BridgeConfig) -> Iterator[None]:
        """Context: a node in the domain."""
        self._topics = RawTopics(config, TAP)
        yield
        self._topics.leave()

    def listening(self, config: BridgeConfig) -> Listen:
        """Return what subscribes to a topic."""
        return self._listen

    def _listen(self, topic: str, take: Take, queue: int) -> RawTopic:
        return self._topics.listen(topic, take, max(queue, LEAST_QUEUE))


if __name__ == "__main__":
    domain = Domain()
    run(domain.listening, domain.joined)
