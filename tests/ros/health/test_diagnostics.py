"""A robot's diagnostics from real nodes: faults are named with their time; floods and garbage delay nothing."""

from __future__ import annotations

import itertools
import re
from io import BytesIO

import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from robots.shared import wire
from robots.shared.configuration.bridge_config import Topic
from tests.processes import until
from tests.ros.bridge_support import drivable, running_bridge, tiago_config
from tests.ros.strangers import Messages, Node, framed

DIAGNOSTICS = Topic("/diagnostics", "diagnostic_msgs/DiagnosticArray")


@pytest.fixture(scope="module", autouse=True)
def robot(ros, simulator):
    return simulator(pose="2,1.8,0", seed=1)


@pytest.fixture
def bridge(rosmaster, robot, tmp_path):
    config = tiago_config(rosmaster, tmp_path, topics={"diagnostics": DIAGNOSTICS})
    with running_bridge(config, rosmaster, tmp_path) as (process, hand):
        hand.state_until(drivable, "a robot that can be driven")
        yield process, hand


@pytest.fixture
def hand(bridge):
    return bridge[1]


def test_a_part_that_becomes_ill_is_named_and_well_again(hand, fault):
    health = hand.state_until(lambda state: state.health, "health").health
    assert (health.level, health.parts) == ("ok", []) and health.well >= 6
    assert health.temperatures[0].name == "Computer" and 40 < health.temperatures[0].celsius < 60
    fault("motor_hot,part_broken")
    health = hand.state_until(
        lambda state: len(state.health.parts) == 2 and state.health.parts[0].since_s >= 2, "two ill parts"
    ).health
    assert [(part.name, part.level, part.text) for part in health.parts] == [
        ("Speakers", "error", "Amplifier does not answer"),
        ("Motors: left wheel", "warning", "Too warm"),
    ]
    assert (health.temperatures[0].name, health.temperatures[0].celsius) == ("Motors: left wheel", 84)
    fault("none")
    hand.state_until(lambda state: state.health.level == "ok", "health again")
    fault("diagnostics_dead")
    silent = hand.state_until(lambda state: state.health.level == "silent", "silence").health
    assert silent.well == 0 and silent.temperatures == []


def test_each_change_goes_on_record(bridge, fault):
    process, hand = bridge
    hand.state_until(lambda state: state.health and state.health.level == "ok", "a healthy robot")
    fault("part_broken")
    worse = re.compile(r"health.worse Speakers ok error \d\.\d Speakers: Amplifier does not answer")
    until(lambda: any(map(worse.fullmatch, process.recorded())), "a record of the fault")
    fault("none")
    better = re.compile(r"health.better Speakers error ok \d\.\d Speakers: OK")
    until(lambda: any(map(better.fullmatch, process.recorded())), "a record of its end")
    assert len([line for line in process.recorded() if line.startswith("health.")]) == 2


def test_a_flood_and_garbage_are_bounded_and_the_robot_drives(hand, fault):
    fault("diagnostics_flood,diagnostics_garbage")
    hand.state_until(
        lambda state: state.health and state.health.parts_more > 100 and state.health.unread > 2, "the flood"
    )
    hand.take_control(1)
    hand.drive_until(0.3, lambda state: state.odometry.vx > 0.1, "a drive")
    hand.stick(0.0)


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


def test_an_error_shows_beside_ok_of_the_same_name(hand, ros, rosmaster):
    """In one message, and from another node with the same name for its part."""

    def spoken(level: int) -> Messages:
        said = BytesIO()
        DiagnosticArray(status=[DiagnosticStatus(name="lift", level=level, message=str(level))]).serialize(
            said
        )
        return itertools.repeat(framed(said.getvalue()))

    both = [DiagnosticStatus(name="gripper", level=level, message=str(level)) for level in (2, 0)]
    with ros.speak("/diagnostics", DiagnosticArray) as topic:
        topic.publish(DiagnosticArray(status=both))
        hand.state_until(lambda state: "gripper" in ill(state), "the error of the gripper")
    with Node(rosmaster.uri, "/lift_1") as first, Node(rosmaster.uri, "/lift_2") as second:
        first.publish("/diagnostics", "diagnostic_msgs/DiagnosticArray", lambda: spoken(0), 3.0)
        second.publish("/diagnostics", "diagnostic_msgs/DiagnosticArray", lambda: spoken(1), 3.0)
        seen = hand.state_until(lambda state: ill(state).get("lift", "").endswith("(/lift_2)"), "two nodes")
        steady = [
            ill(hand.state_until(lambda state: state is not seen, "a state")).get("lift") for _ in range(40)
        ]
    assert set(steady) == {"1 (/lift_2)"}


def ill(state: wire.State) -> dict[str, str]:
    return {part.name: part.text for part in state.health.parts} if state.health else {}
