"""A robot's diagnostics: faults are named with their time; a flood delays nothing."""

from __future__ import annotations

import re
from contextlib import closing

import pytest

from robots.shared import wire
from tests.processes import until
from tests.sides.visitor import Visitor

TOPIC = "/diagnostics", "diagnostic_msgs/DiagnosticArray"


@pytest.fixture
def config(side, tmp_path):
    return side.config(tmp_path, "diagnostics")


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


def test_each_change_goes_on_record(bridge, hand, fault):
    hand.state_until(lambda state: state.health and state.health.level == "ok", "a healthy robot")
    fault("part_broken")
    worse = re.compile(r"health.worse Speakers ok error \d\.\d Speakers: Amplifier does not answer")
    until(lambda: any(map(worse.fullmatch, bridge.recorded())), "a record of the fault")
    fault("none")
    better = re.compile(r"health.better Speakers error ok \d\.\d Speakers: OK")
    until(lambda: any(map(better.fullmatch, bridge.recorded())), "a record of its end")
    assert len([line for line in bridge.recorded() if line.startswith("health.")]) == 2


def test_a_flood_and_garbage_are_bounded_and_the_robot_drives(hand, fault):
    fault("diagnostics_flood,diagnostics_garbage")
    hand.state_until(
        lambda state: state.health and state.health.parts_more > 100 and state.health.unread > 2, "the flood"
    )
    hand.drive_until(0.3, lambda state: state.odometry.vx > 0.1, "a drive")
    hand.stick(0.0)


def test_an_error_shows_beside_ok_of_the_same_name(side, visitor, hand, tmp_path):
    """In one message, and from another node with the same name for its part."""
    with visitor.speak(*TOPIC) as topic:
        topic.publish(status=[status("gripper", 2), status("gripper", 0)])
        hand.state_until(lambda state: "gripper" in ill(state), "the error of the gripper")
    with (
        closing(Visitor(side, tmp_path, "other")) as other,
        visitor.speak(*TOPIC) as well,
        other.speak(*TOPIC) as worse,
    ):
        well.repeat(3.0, status=[status("lift", 0)])
        worse.repeat(3.0, status=[status("lift", 1)])
        seen = hand.state_until(lambda state: ill(state).get("lift", "").endswith("(/other)"), "two nodes")
        steady = [
            ill(hand.state_until(lambda state: state is not seen, "a state")).get("lift") for _ in range(40)
        ]
    assert set(steady) == {"1 (/other)"}


def status(name: str, level: int) -> dict[str, object]:
    return {"name": name, "level": level, "message": str(level)}


def ill(state: wire.State) -> dict[str, str]:
    return {part.name: part.text for part in state.health.parts} if state.health else {}
