"""The topics of a robot, for the recorder."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import rosgraph
import rospy

from robots.bridge.ros import child_node
from robots.bridge.ros.inspector.definitions import Definitions
from robots.bridge.ros.raw_topic import RawTopic
from robots.bridge.tap.raw_topic import Take
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.graph import RECORDER, SystemState
from robots.shared.ros.master import Master

WAIT_S = 0.004  # before each read: a topic that floods costs as much as 250 reads a second
# The same for pictures of which few are kept. Each read takes all that waits, so that the newest is not old.
THINNED_WAIT_S = 0.2
THINNED_BYTES = 8 * 1024 * 1024


class RecordedTopics:
    """The topics of the robot that this process has joined."""

    encoding = "ros1"

    def __init__(self, definitions: Definitions) -> None:
        self._definitions = definitions

    def listen(self, topic: str, take: Take, *, thins: bool) -> RawTopic:
        if thins:
            return RawTopic(topic, self._definitions, take, lambda: THINNED_WAIT_S, 1, THINNED_BYTES)
        return RawTopic(topic, self._definitions, take, lambda: WAIT_S, None)

    def survey(self) -> SystemState:
        return Master(rosgraph.get_master_uri(), rospy.get_caller_id()).system_state()

    def leave(self) -> None:
        child_node.leave()


def joined(config: BridgeConfig, at_end: Callable[[], object]) -> RecordedTopics:
    """Join the robot. `at_end` is called before the process ends with the master."""
    child_node.join(config, RECORDER, at_end)
    return RecordedTopics(Definitions(Path(config.state_dir) / "definitions"))
