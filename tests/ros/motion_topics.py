"""The motion actions of a robot, without its node."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

from robots.bridge.robot.incoming.mailboxes import Mailboxes
from robots.bridge.robot.tasks.motions import RecordedMotions
from robots.bridge.ros.network.parameters import MasterParameters
from robots.bridge.ros.tasks.motions import MotionTopics
from robots.shared.ros.master import Master


@contextmanager
def motion_topics(
    names: Collection[str], master_uri: str, offers: Callable[..., Any], tasks: Any = None
) -> Iterator[RecordedMotions]:
    """Yield the topics of these actions. `offers` gets all lists of motions, `tasks` all reports."""
    of_holder = SimpleNamespace(
        routing=Mock(connected=lambda _use: names), capabilities=Mock(read=offers), motions=tasks or Mock()
    )
    node = Mock(
        parameters=MasterParameters(Master(master_uri, "/test")),
        mail=Mailboxes(lambda call: call()),
        post=lambda call: call(),
        tasks=of_holder,
    )
    node.config.topics.motions.type = "play_motion_msgs/PlayMotionAction"
    topics = MotionTopics.of(node)
    try:
        yield topics
    finally:
        for action in topics._actions.values():
            action.close()
