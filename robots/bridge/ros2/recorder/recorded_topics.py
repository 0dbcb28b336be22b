"""The topics of a robot, for the recorder."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable

from robots.bridge.ros2.inspector import graph
from robots.bridge.ros2.network.graph import Graph
from robots.bridge.ros2.network.survey import is_there
from robots.bridge.ros2.raw_topic import RawTopic, RawTopics
from robots.bridge.tap.raw_topic import Take
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.graph import RECORDER, SystemState
from robots.shared.ros2.environment import wide_sockets

log = logging.getLogger(__name__)

QUEUE = 100  # messages of a topic that wait for the executor
GONE_S = 2.0  # a robot of which nothing is there for so long has left
LOOK_S = 0.2


class RecordedTopics:
    """The topics of the domain that this process has joined."""

    encoding = "cdr"

    def __init__(self, config: BridgeConfig) -> None:
        self._topics = RawTopics(config, RECORDER)
        self._graph = Graph(self._topics.participant.node)
        self._robots = config.topics

    def listen(self, topic: str, take: Take, *, thins: bool) -> RawTopic:
        return self._topics.listen(topic, take, 1 if thins else QUEUE)

    def survey(self) -> SystemState:
        return graph.published(self._topics.participant.node)

    def leave(self) -> None:
        self._topics.leave()

    def work(self, work: Callable[[], None], name: str) -> None:
        """Run what the process needs on a thread, until it leaves."""
        self._topics.participant.work(work, name)

    @property
    def found(self) -> bool:
        """Whether the robot was there at the beginning."""
        return self._topics.found

    def await_its_end(self) -> None:
        """Wait until the robot has left."""
        seen_s = time.monotonic()
        while time.monotonic() < seen_s + GONE_S:
            time.sleep(LOOK_S)
            if is_there(self._graph, self._robots, self._robots.drive.name):
                seen_s = time.monotonic()


def joined(config: BridgeConfig, at_end: Callable[[], object]) -> RecordedTopics:
    """Join the robot. `at_end` is called before the process ends with the robot."""
    with wide_sockets():
        topics = RecordedTopics(config)
    if not topics.found:
        raise SystemExit("nothing of this robot is in its domain")

    def end_with_the_robot() -> None:
        topics.await_its_end()
        log.warning("nothing of this robot is in its domain any more")
        at_end()
        os._exit(1)

    topics.work(end_with_the_robot, "robot")
    return topics
