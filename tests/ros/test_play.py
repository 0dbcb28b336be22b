"""A recorded motion from the link to the robot's arm: with room it is performed, without it is not."""

from __future__ import annotations

from robots.bridge.ros import path  # noqa: F401  (first: makes rospy importable)

# isort: split
import math
from contextlib import contextmanager

import msgspec
import pytest
import rospy
from geometry_msgs.msg import Pose2D
from nav_msgs.msg import Odometry
from std_msgs.msg import String

from robots import wire
from robots.bridge.config import Topic
from tests.ros.bridge_support import BridgeProcess, drivable, tiago_config
from tests.ros.support import until
from tests.ros.test_posture import ARM

IN_THE_OPEN = Pose2D(3.8, 2.2, 0.0)
BEFORE_WALL = Pose2D(7.6, 0.75, -math.pi / 2.0)  # the wall's face is at y = 0
FAR_AWAY, BEFORE_THE_ROBOT = "person 8.8 1.0", "person 4.5 2.2"


@pytest.fixture(scope="module", autouse=True)
def robot(ros, simulator):
    return simulator(pose="3.8,2.2,0", seed=1)


@contextmanager
def bridge(master, folder):
    """A bridge of a TIAGo with an arm, and its records so far."""
    config = tiago_config(master, folder)
    topics = msgspec.structs.replace(
        config.topics,
        arm=ARM,
        joint_states=Topic("/joint_states", "sensor_msgs/JointState"),
        motions=Topic("/play_motion", "play_motion_msgs/PlayMotionAction"),
    )
    gate = msgspec.structs.replace(config.gate, has_arm=True, has_depth=False)
    process = BridgeProcess(msgspec.structs.replace(config, topics=topics, gate=gate), master, folder)
    hand = process.link()
    try:
        hand.until(lambda report: isinstance(report, wire.Offers) and report.motions, "a robot with motions")
        hand.state_until(drivable, "a robot that sees")
        hand.take_control(1)
        yield hand, lambda: process.records.read_text().splitlines()
    finally:
        hand.close()
        process.stop()


@contextmanager
def at(ros, pose):
    """The robot stands there."""
    with (
        ros.listen("/ground_truth/pose", Odometry) as truth,
        ros.speak("/ground_truth/teleport", Pose2D) as teleport,
    ):
        teleport.publish(pose)
        truth.until(
            lambda message: (
                math.hypot(message.pose.pose.position.x - pose.x, message.pose.pose.position.y - pose.y)
                < 0.01
            )
        )
        yield


def play(hand, motion):
    hand.send(wire.Play(1, motion))
    hand.until(lambda report: isinstance(report, wire.Accepted) and report.of == "play", "a yes")
    return hand.state_until(lambda state: state.motion, f"{motion} under way")


def test_with_room_it_is_performed_and_its_end_is_on_record(ros, rosmaster, tmp_path):
    with at(ros, IN_THE_OPEN), bridge(rosmaster, tmp_path) as (hand, records):
        state = play(hand, "close_half")
        assert state.motion.name == "close_half"
        hand.state_until(lambda state: state.motion_ended, "its end")
        play(hand, "offer")
        hand.stick(0.5)
        hand.until(
            lambda report: isinstance(report, wire.Refused) and report.refusal.code == "motion_running",
            "a base that stands meanwhile",
        )
        hand.let_go()
        hand.state_until(lambda state: state.motion_ended.name == "offer", "the end")
        until(lambda: len(records()) >= 4, "its end on record")
        assert records()[-2:] == ["motion.start offer /play_motion", "motion.end succeeded"]
        play(hand, "home")
        hand.state_until(lambda state: state.motion_ended.name == "home", "an arm at home")


def test_before_a_wall_it_is_refused_with_figures(ros, rosmaster, tmp_path):
    with at(ros, BEFORE_WALL), bridge(rosmaster, tmp_path) as (hand, records):
        hand.send(wire.Play(1, "offer"))
        refused = hand.until(
            lambda report: isinstance(report, wire.Refused) and report.of == "play", "a refusal"
        )
        assert refused.refusal.code == "motion_blocked"
        assert 0.3 < refused.refusal.figures["distance_m"] < 0.6
        assert refused.refusal.figures["side"].startswith("ahead")
        until(lambda: len(records()) == 2, "why it was not begun on record")
        assert records() == ["motion.start offer /play_motion", "motion.end motion_blocked"]


def test_an_intruder_cancels_it(ros, rosmaster, tmp_path):
    with (
        at(ros, IN_THE_OPEN),
        bridge(rosmaster, tmp_path) as (hand, records),
        ros.speak("/ground_truth/person", String) as person,
    ):
        play(hand, "offer")
        person.publish(BEFORE_THE_ROBOT)
        try:
            state = hand.state_until(lambda state: state.motion_ended, "its end")
            assert state.motion_ended.outcome == "intruder", state.motion_ended
            until(lambda: records()[-1] == "motion.end intruder", "its end on record")
        finally:
            person.publish(FAR_AWAY)


def test_who_may_cancels_it_by_its_goal(ros, rosmaster, tmp_path):
    with at(ros, IN_THE_OPEN), bridge(rosmaster, tmp_path) as (hand, records):
        play(hand, "inspect_surroundings")
        hand.send(wire.LinkCancel("motion", "Sue", seq=3))
        hand.until(lambda report: report == wire.Accepted("link_cancel", 3), "an answer")
        state = hand.state_until(lambda state: state.motion_ended, "its end")
        assert (state.motion_ended.outcome, state.motion_ended.text) == ("cancelled", "Cancelled by Sue.")
        until(lambda: records()[-1] == "motion.end cancelled", "its end on record")


def test_a_motion_that_was_recorded_anew_is_judged_by_its_new_points_and_the_list_is_read_again(
    ros, rosmaster, tmp_path
):
    opens, reaches_out = (rospy.get_param(f"/play_motion/motions/{name}") for name in ("open", "offer"))
    with at(ros, BEFORE_WALL), bridge(rosmaster, tmp_path) as (hand, records):
        rospy.set_param("/play_motion/motions/open", {**reaches_out, "meta": {"name": "Anew"}})
        try:
            told = {}  # in either order

            def all_told(report):
                if isinstance(report, wire.Refused) and report.of == "play":
                    told["refusal"] = report.refusal
                if isinstance(report, wire.Offers) and "Anew" in [motion.title for motion in report.motions]:
                    told["list"] = report.motions
                return len(told) == 2

            hand.send(wire.Play(1, "open"))
            hand.until(all_told, "a refusal, and the list as it is now")
            assert told["refusal"].code == "motion_blocked"
            assert len(told["list"]) == len(rospy.get_param("/play_motion/motions"))
        finally:
            rospy.set_param("/play_motion/motions/open", opens)
        play(hand, "open")  # which moves no arm, by its points of now
        hand.state_until(lambda state: state.motion_ended, "its end")
        assert records()[:3] == [
            "motion.start open /play_motion",
            "motion.end motion_blocked",
            "motion.start open /play_motion",
        ]
