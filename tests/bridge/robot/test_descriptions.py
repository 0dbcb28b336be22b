"""When a robot's description is read, and who gets it: seldom while somebody drives."""

from __future__ import annotations

import pytest
from msgspec import structs

from robots.bridge.arm.posture import ArmPosture
from robots.bridge.robot.description import descriptions
from robots.bridge.robot.description.descriptions import Descriptions
from robots.bridge.robot.incoming.reception import Reception
from robots.shared.graph import SystemState
from robots.shared.unreachable import Unreachable
from tests.bridge.support import CONFIG
from tests.ros.tiago_arm import ARM, DESCRIPTION, HAND, JOINT_STATES, without_hand


class Robot:
    """A robot with a description, and a clock of its own."""

    def __init__(self, monkeypatch):
        self.posture = ArmPosture(ARM)
        self.now_s = 1000.0
        self.description: object = DESCRIPTION
        self.publishers = {"/tf": ["/state_publisher"], "/joint_states": ["/controllers"], "/chat": ["/a"]}
        self.readings = 0
        self.taken: list[str] = []
        self.in_use = False
        topics = structs.replace(CONFIG.topics, arm=ARM, joint_states=JOINT_STATES)
        reception = Reception(topics)
        reception.core = self
        monkeypatch.setattr(reception, "post", lambda call: call())
        monkeypatch.setattr(descriptions.time, "monotonic", lambda: self.now_s)
        self.descriptions = Descriptions(topics, self.ask, self.posture, reception)
        self.descriptions.read()

    def ask(self):
        self.readings += 1
        if isinstance(self.description, Exception):
            raise self.description
        return self.description

    def described(self, taken, _failed):
        self.taken.append(taken.problem or taken.digest[:4])

    def surveys(self, seconds, **publishers):
        for _ in range(int(seconds / 2)):
            self.now_s += 2.0
            self.descriptions.surveyed(SystemState({**self.publishers, **publishers}, {}, {}, {}))


@pytest.fixture
def robot(monkeypatch):
    return Robot(monkeypatch)


def test_a_robot_that_stays_is_asked_seldom_and_handed_on_once(robot):
    robot.surveys(600)
    assert robot.readings <= 12 and len(robot.taken) == 1
    robot.in_use = True
    before = robot.readings
    robot.surveys(600)
    assert robot.readings == before  # while the control loop runs, no description is parsed


def test_a_start_that_no_survey_saw_is_found_while_nobody_has_control(robot):
    robot.description = without_hand()
    robot.surveys(62)
    assert len(robot.taken) == 2 and robot.posture._model.lacking == [HAND]


@pytest.mark.parametrize("topic", ["/tf", "/joint_states", CONFIG.topics.odometry.name])
def test_nodes_that_come_and_go_lead_to_a_reading_also_in_control(robot, topic):
    robot.surveys(20)
    robot.in_use = True
    robot.surveys(2, **{topic: []})
    robot.description = without_hand()
    robot.surveys(6, **{topic: ["/another"]})
    assert len(robot.taken) == 2 and robot.posture._model.lacking == [HAND]


def test_nodes_of_other_topics_lead_to_none_and_restless_ones_to_few(robot):
    robot.surveys(20)
    before = robot.readings
    robot.surveys(20, **{"/chat": ["/b"]})
    assert robot.readings == before
    for number in range(30):
        robot.surveys(2, **{"/tf": [f"/restless_{number}"]})
    assert robot.readings - before <= 60 / descriptions.RESTARTED_S


@pytest.mark.parametrize("missing", [None, Unreachable("no answer")])
def test_a_known_description_stays_while_none_can_be_read(robot, missing):
    known = robot.posture._model
    robot.description = missing
    robot.surveys(70)
    assert robot.posture._model is known and len(robot.taken) == 1
    robot.description = without_hand()
    robot.surveys(2)
    assert robot.posture._model.lacking == [HAND]


def test_a_reading_that_fails_in_control_waits_for_its_end(robot):
    robot.surveys(20)
    robot.in_use, robot.description = True, Unreachable("no answer")
    before = robot.readings
    robot.surveys(60, **{"/tf": ["/another"]})
    assert robot.readings == before + 1
    robot.in_use, robot.description = False, without_hand()
    robot.surveys(62)
    assert robot.posture._model.lacking == [HAND]


def test_restless_nodes_lead_to_few_readings_in_control(robot):
    robot.surveys(20)
    robot.in_use = True
    before = robot.readings
    for number in range(60):
        robot.surveys(2, **{"/tf": [f"/restless_{number}"]})
    assert robot.readings - before <= descriptions.FRUITLESS + 120 / descriptions.DESCRIBED_S


def test_a_large_new_description_waits_for_the_end_of_control(robot):
    robot.surveys(20)
    robot.in_use, robot.description = True, without_hand() + " " * descriptions.LARGE
    robot.surveys(60, **{"/tf": ["/another"]})
    assert len(robot.taken) == 1 and robot.posture._model.lacking == []
    robot.in_use = False
    robot.surveys(62)
    assert robot.posture._model.lacking == [HAND]


def test_what_the_console_could_not_keep_is_handed_on_again(robot):
    robot.descriptions._ask_again()
    robot.surveys(2)
    assert len(robot.taken) == 2
