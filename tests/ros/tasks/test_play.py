"""A recorded motion from the link to the robot's arm: performed in free space, otherwise refused."""

from __future__ import annotations

import math
from contextlib import contextmanager

import pytest
import rospy
from actionlib_msgs.msg import GoalStatus
from geometry_msgs.msg import Pose2D

from robots.shared import wire
from robots.shared.configuration.bridge_config import Topic
from robots.shared.ros.message_types.classes import message_class
from tests.processes import until
from tests.ros.bridge_support import drivable, running_bridge, tiago_config
from tests.ros.performing import ask, asked, numbers, perform, play
from tests.ros.support import SimulatorProcess
from tests.ros.tiago_arm import ARM, JOINT_STATES

IN_THE_OPEN = Pose2D(3.8, 2.2, 0.0)
BEFORE_WALL = Pose2D(7.6, 0.75, -math.pi / 2.0)  # the wall's face is at y = 0


@pytest.fixture(scope="module", autouse=True)
def robot(ros, simulator):
    return simulator(pose="3.8,2.2,0", seed=1)


def with_arm(master, folder, action="/play_motion"):
    """The configuration of a TIAGo with an arm."""
    motions = Topic(action, "play_motion_msgs/PlayMotionAction")
    topics = {"arm": ARM, "joint_states": JOINT_STATES, "motions": motions}
    return tiago_config(master, folder, topics=topics, gate={"has_arm": True, "has_depth": False})


@contextmanager
def bridge(master, folder):
    """A link in control of a TIAGo, and its bridge."""
    with running_bridge(with_arm(master, folder), master, folder) as (process, hand):
        hand.until(lambda report: isinstance(report, wire.Offers) and report.motions, "a robot with motions")
        hand.state_until(drivable, "a robot that sees")
        hand.take_control(1)
        yield hand, process


def test_the_next_bridge_cancels_a_killed_bridges_motion(ros, rosmaster, tmp_path):
    result = message_class("play_motion_msgs/PlayMotionActionResult")
    with ros.at(IN_THE_OPEN), ros.listen("/play_motion/result", result) as results:
        ros.connected(results)
        with bridge(rosmaster, tmp_path) as (hand, first):
            play(hand, "inspect_surroundings")
            first.kill()
        with bridge(rosmaster, tmp_path) as (hand, _):
            assert results.next().status.status == GoalStatus.PREEMPTED
            assert perform(hand, "close").outcome == "succeeded"


def test_a_changed_motion_is_judged_by_its_new_points(ros, rosmaster, tmp_path):
    opens, reaches_out = (rospy.get_param(f"/play_motion/motions/{name}") for name in ("open", "offer"))
    with ros.at(BEFORE_WALL), bridge(rosmaster, tmp_path) as (hand, process):
        rospy.set_param("/play_motion/motions/open", {**reaches_out, "meta": {"name": "Anew"}})
        try:
            reports = {}  # in either order

            def both_arrived(report):
                if isinstance(report, wire.Refused) and report.of == "play":
                    reports["refusal"] = report.refusal
                if isinstance(report, wire.Offers) and "Anew" in [motion.title for motion in report.motions]:
                    reports["list"] = report.motions
                return len(reports) == 2

            hand.send(wire.Play(1, "open"))
            hand.until(both_arrived, "a refusal, and the list as it is now")
            assert reports["refusal"].code == "motion_blocked"
            assert len(reports["list"]) == len(rospy.get_param("/play_motion/motions"))
        finally:
            rospy.set_param("/play_motion/motions/open", opens)
        assert perform(hand, "open").outcome == "succeeded"  # here `open` does not move the arm
        assert process.recorded()[:3] == [
            "motion.start open /play_motion",
            "motion.end motion_blocked",
            "motion.start open /play_motion",
        ]


def test_the_list_is_read_again_when_motions_restart(ros, rosmaster, tmp_path):
    described = rospy.get_param("/play_motion/motions/open")
    with bridge(rosmaster, tmp_path) as (hand, _):
        rospy.set_param("/play_motion/motions/open", {**described, "meta": {"name": "Anew"}})
        try:
            with ros.listen("/play_motion/goal", message_class("play_motion_msgs/PlayMotionActionGoal")):
                hand.until(
                    lambda report: (
                        isinstance(report, wire.Offers)
                        and "Anew" in [offer.title for offer in report.motions]
                    ),
                    "the list as it is now",
                )
        finally:
            rospy.set_param("/play_motion/motions/open", described)


def test_an_action_that_has_just_joined_performs(ros, rosmaster, tmp_path):
    """The bridge surveys the robot every 2 s: the last survey does not contain the new action yet."""
    goals, results = (
        message_class(f"play_motion_msgs/PlayMotionAction{part}") for part in ("Goal", "Result")
    )
    with running_bridge(with_arm(rosmaster, tmp_path, "/late_play"), rosmaster, tmp_path) as (_, hand):
        hand.state_until(drivable, "a robot that sees")
        hand.take_control(1)
        assert asked(hand, "nod").code == "no_listener"
        motion = {"joints": ["head_1_joint"], "points": [{"positions": [0.0]}]}
        rospy.set_param("/late_play/motions/nod", motion)
        with ros.listen("/late_play/goal", goals) as inbox:
            result = rospy.Publisher("/late_play/result", results, queue_size=1)
            assert ask(hand, "nod") is None
            assert inbox.next().goal.motion_name == "nod"
            result.unregister()


@pytest.mark.last  # it ends the robot
def test_a_motion_in_the_first_second_online_is_accepted(rosmaster, robot, tmp_path):
    """A robot comes online before the bridge's next survey of its nodes."""
    with running_bridge(with_arm(rosmaster, tmp_path), rosmaster, tmp_path) as (_, hand):
        hand.state_until(drivable, "a robot that sees")
        hand.take_control(1)
        robot.stop()
        for start in range(5):
            until(lambda: hand.state.phase != "online", "a robot that left")
            again = SimulatorProcess(rosmaster, tmp_path / "robot.log", f"again-{start}", pose="3.8,2.2,0")
            try:
                until(lambda: hand.state.phase == "online", "a robot that is back")
                again.wait_ready()  # until then, no node subscribes to motions
                assert ask(hand, "home") is None
                until(lambda: hand.state.motion, "a motion")
                hand.send(wire.LinkCancel("motion", "Sue", seq=next(numbers)))
                until(lambda: hand.state.motion is None, "the end")
            finally:
                again.stop()
