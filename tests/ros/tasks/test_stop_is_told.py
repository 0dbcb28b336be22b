"""A stop cancels every goal that a part of the robot can send; the watchdog does so without a bridge."""

from types import SimpleNamespace
from unittest.mock import Mock

import msgspec
import pytest
import rospy

from robots.bridge.robot.inputs import Inputs
from robots.bridge.robot.parts import Parts
from robots.bridge.ros.node import PARTS
from robots.registry.configuration.robot_config import profile_topics
from robots.registry.models import RobotProfile
from robots.registry.shipped_profiles import profile_files
from robots.shared.configuration.watchdog_config import watchdog_config
from tests.bridge.support import CONFIG, ORDERS, Bench, MemoryBase, ObedientBench

SHIPPED = {
    file.slug: profile_topics(RobotProfile(**file.columns())) for file in profile_files() if file.ros == 1
}
# Topics of the robot's parts to which a stop sends nothing.
NOT_TOLD = {
    "/head_controller/command": "the controller ends each position by itself",
    "/initialpose": "it moves nothing",
}
# Actions whose goals never wait for a listener: the part has nothing to withdraw, and the node cancels them.
AT_ONCE = {"/head_controller/point_head_action"}


@pytest.fixture
def topics(monkeypatch):
    """The topics of publishers that were made, and those on which something was published."""
    made, used = set(), set()

    def publisher(topic, *_args, **_options):
        made.add(topic)
        return Mock(publish=lambda _message: used.add(topic))

    monkeypatch.setattr(rospy, "Publisher", publisher)
    monkeypatch.setattr(rospy, "Subscriber", Mock())
    return SimpleNamespace(made=made, used=used)


def parts(bench):
    """The robot's parts over ROS."""
    found = Parts(PARTS)
    found.connect(Mock(config=bench.core.config, tasks=bench.core.tasks))
    return found.connected


def ending(topics, end):
    return {topic.removesuffix(end) for topic in topics if topic.endswith(end)}


@pytest.mark.parametrize("profile", [None, *SHIPPED])
def test_a_stop_reaches_every_action_of_the_robot(topics, profile):
    config = (
        msgspec.structs.replace(CONFIG, topics=SHIPPED[profile]) if profile else ObedientBench().core.config
    )
    # the list in the profile is for programs of others
    own = msgspec.structs.replace(config.topics, cancel_on_stop=[])
    config = msgspec.structs.replace(config, topics=own)
    cancels = [cancel for part in parts(Bench(config=config)) for cancel in part.cancels]
    actions = ending(topics.made, "/goal")
    assert actions == set(watchdog_config(config).actions)
    for cancel in cancels:
        cancel()
    of_actions = {f"{action}{end}" for action in actions for end in ("/goal", "/cancel")}
    assert topics.made - topics.used - of_actions <= NOT_TOLD.keys()
    assert actions - ending(topics.used, "/cancel") <= AT_ONCE & set(own.cancelled)


def test_the_robot_has_every_part_that_tasks_ask_for(topics, monkeypatch):
    asked = set()
    monkeypatch.setattr(MemoryBase, "part", lambda base, kind: asked.add(kind) or base)
    for order in ORDERS.values():
        bench = ObedientBench()
        bench.ask(order)
        bench.obeys()
        bench.core.stop("Bob", "", bench.now_s)
    has = [Inputs, *map(type, parts(bench))]
    assert [kind for kind in asked if not any(issubclass(part, kind) for part in has)] == []
