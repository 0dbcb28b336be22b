"""Diagnostics of a node that dies, with a text that no other node can read."""

from __future__ import annotations

import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from robots.shared.configuration.bridge_config import Topic
from tests.ros.bridge_support import drivable, running_bridge, tiago_config

DIAGNOSTICS = Topic("/diagnostics", "diagnostic_msgs/DiagnosticArray")


@pytest.fixture(scope="module", autouse=True)
def robot(ros, simulator):
    return simulator(pose="2,1.8,0", seed=1)


@pytest.fixture
def hand(rosmaster, robot, tmp_path):
    config = tiago_config(rosmaster, tmp_path, topics={"diagnostics": DIAGNOSTICS})
    with running_bridge(config, rosmaster, tmp_path) as (_, hand):
        hand.state_until(drivable, "a robot that can be driven")
        yield hand


def test_a_node_that_dies_and_texts_that_are_no_utf_8_harm_nothing(hand, ros):
    with ros.speak("/diagnostics", DiagnosticArray) as topic:
        wrong = DiagnosticStatus(name="gripper", level=DiagnosticStatus.ERROR, message="kaputt \udce4")
        topic.publish(DiagnosticArray(status=[DiagnosticStatus(name="gripper", level=2, message="kaputt")]))
        hand.state_until(lambda state: state.health and state.health.level == "error", "the error")
        with pytest.raises((rospy.ROSException, UnicodeError)):
            topic.publish(DiagnosticArray(status=[wrong]))
    health = hand.state_until(lambda state: "silent" in state.health.parts[0].text, "silence").health
    [part] = health.parts
    assert (part.name, part.level) == ("gripper", "error") and part.text.startswith("kaputt; silent for ")
