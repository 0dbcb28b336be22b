"""A recorded motion from the link to the robot's arm: performed in free space, otherwise refused."""

from __future__ import annotations

import math
import signal
import time
from contextlib import contextmanager

import pytest

from robots.shared import wire
from tests.processes import until
from tests.ros.bridge_support import drivable, running_bridge
from tests.ros.performing import ask, asked, end_of, numbers, perform, play

IN_THE_OPEN = (3.8, 2.2, 0.0)
BEFORE_WALL = (7.6, 0.75, -math.pi / 2.0)  # the wall's face is at y = 0
FAR_FROM_WALL = (7.6, 1.0, -math.pi / 2.0)  # farther than `reach_m`, within reach of `reach_max`
FAR_AWAY, BEFORE_THE_ROBOT = "person 8.8 1.0", "person 4.5 2.2"


@pytest.fixture(scope="module")
def robot(simulator):
    return simulator(pose="3.8,2.2,0", seed=1)


@pytest.fixture
def bridge(side, robot, tmp_path):
    """``with bridge() as (hand, process)``: a link in control of a TIAGo with its arm."""

    @contextmanager
    def begin():
        parts = ("arm", "joint_states", "motions")
        config = side.config(tmp_path, *parts, gate={"has_depth": False})
        with running_bridge(config, side, tmp_path) as (process, hand):
            hand.until(lambda report: isinstance(report, wire.Offers) and report.motions, "motions")
            hand.state_until(drivable, "a robot that sees")
            hand.take_control(1)
            yield hand, process

    return begin


@pytest.fixture
def at(visitor, robot):
    """``at(pose)`` places the robot."""

    def place(pose):
        with visitor.at(*pose):
            pass

    return place


def test_with_space_it_is_performed_and_its_end_recorded(side, at, bridge):
    at(IN_THE_OPEN)
    with bridge() as (hand, process):

        def push():
            hand.stick(0.5)
            hand.until(
                lambda report: isinstance(report, wire.Refused) and report.refusal.code == "motion_running",
                "a base that stands meanwhile",
            )
            hand.let_go()

        assert perform(hand, "close_half").outcome == "succeeded"
        assert perform(hand, "offer", push).outcome == "succeeded"
        until(lambda: len(process.recorded()) >= 4, "its end on record")
        action = side.topics.motions.name
        assert process.recorded()[-2:] == [f"motion.start offer {action}", "motion.end succeeded"]
        assert perform(hand, "home").outcome == "succeeded"
        hand.state_until(lambda state: not state.arm, "an arm at home")


def test_before_a_wall_it_is_refused_with_figures(side, at, bridge):
    at(BEFORE_WALL)
    with bridge() as (hand, process):
        refusal = ask(hand, "offer")
        assert refusal.code == "motion_blocked", refusal
        assert 0.3 < refusal.figures["distance_m"] < 0.6
        assert refusal.figures["side"].startswith("ahead")
        until(lambda: "motion_blocked" in process.recorded()[-1], "why it was not begun on record")
        action = side.topics.motions.name
        assert process.recorded()[-2:] == [f"motion.start offer {action}", "motion.end motion_blocked"]


def test_without_joint_states_it_is_refused(at, bridge, fault):
    at(FAR_FROM_WALL)
    with bridge() as (hand, _):
        refusal = ask(hand, "reach_max")
        assert refusal.code == "motion_blocked", refusal
        fault("joints_dead")
        hand.state_until(lambda state: any(limit.code == "arm_away" for limit in state.verdict.limits), "it")
        refusal = asked(hand, "reach_max")
        assert (refusal.code, refusal.figures["sensor"]) == ("not_watched", "arm"), refusal
        fault("none")
        refusal = ask(hand, "reach_max")
        assert refusal.code == "motion_blocked", refusal


def test_an_intruder_cancels_it(at, bridge, visitor):
    at(IN_THE_OPEN)
    with bridge() as (hand, process), visitor.speak("/ground_truth/person", "std_msgs/String") as person:
        try:
            ended = perform(hand, "offer", lambda: person.publish(data=BEFORE_THE_ROBOT))
            assert ended.outcome == "intruder", ended
            until(lambda: process.recorded()[-1] == "motion.end intruder", "its end on record")
        finally:
            person.publish(data=FAR_AWAY)


def test_people_with_the_right_cancel_it_by_its_goal(at, bridge):
    at(IN_THE_OPEN)
    with bridge() as (hand, process):
        begun = play(hand, "inspect_surroundings")
        hand.send(wire.LinkCancel("motion", "Sue", seq=3))
        hand.until(lambda report: report == wire.Accepted("link_cancel", 3), "an answer")
        ended = end_of(hand, begun)
        assert (ended.outcome, ended.text) == ("cancelled", "Cancelled by Sue.")
        until(lambda: process.recorded()[-1] == "motion.end cancelled", "its end on record")


def test_a_starved_bridge_accepts_no_motion_before_a_wall(at, bridge):
    at(FAR_FROM_WALL)
    with bridge() as (hand, process):
        for _ in range(4):
            process.process.send_signal(signal.SIGSTOP)
            hand.send(wire.Play(1, "reach_max", number := next(numbers)))
            time.sleep(1.2)  # longer than any sensor may be silent
            process.process.send_signal(signal.SIGCONT)
            answer = hand.until(
                lambda report, number=number: (
                    isinstance(report, wire.Accepted | wire.Refused) and report.seq == number
                ),
                "an answer",
            )
            assert isinstance(answer, wire.Refused), answer
            hand.state_until(drivable, "a robot that sees")
