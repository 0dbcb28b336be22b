"""Reports of a robot's motion action in words: names, codes, ends. The test is the action server."""

from __future__ import annotations

import queue
from contextlib import contextmanager

import pytest
import rospy
from actionlib_msgs.msg import GoalStatus

from robots.bridge.gate.arm.sweep import Motion
from robots.bridge.ros.tasks.motions import ERRORS
from robots.bridge.tasks.goals import OURS
from robots.shared.ros.message_types.classes import message_class, service_class
from robots.shared.wire import MotionOffer
from tests.processes import PATIENCE_S, until
from tests.ros.motion_topics import motion_topics
from tests.ros.spoiled_master import CUT_SHORT, spoiling

ACTION = "/odd_play"
GOAL, ENDED = (message_class(f"play_motion_msgs/PlayMotionAction{part}") for part in ("Goal", "Result"))
CODES = message_class("play_motion_msgs/PlayMotionResult")
ODD_NAME = "grüß <b>你好 & Co."


class Heard:
    """Stores all reports of a bridge's `Motions`."""

    def __init__(self):
        self.ends = queue.SimpleQueue()
        self.lists = queue.SimpleQueue()

    def running(self, action, goal_ids, now_s): ...

    def ended(self, goal_id, outcome, text, now_s):
        self.ends.put((goal_id, outcome, text))

    def offers(self, action, motions, text):
        self.lists.put(motions)

    def topics(self, uri):
        return motion_topics({ACTION}, uri, self.offers, self)


@pytest.fixture
def heard():
    return Heard()


@pytest.fixture
def motions(ros, rosmaster, heard):
    with heard.topics(rosmaster.uri) as topics:
        yield topics


@contextmanager
def action(answer=None):
    """An action server that answers each goal with `answer`. Yields its goals."""
    goals = queue.SimpleQueue()
    results = rospy.Publisher(f"{ACTION}/result", ENDED, queue_size=5)

    def take(goal):
        if answer is not None:
            results.publish(answer(goal))
        goals.put(goal)

    taking = rospy.Subscriber(f"{ACTION}/goal", GOAL, take)
    try:
        until(results.get_num_connections, "somebody who hears results")
        yield goals
    finally:
        taking.unregister()
        results.unregister()


def result(status, code, words=""):
    def answer(goal):
        ended = ENDED()
        ended.status.goal_id.id, ended.status.status = goal.goal_id.id, status
        ended.result.error_code, ended.result.error_string = code, words
        return ended

    return answer


@pytest.mark.parametrize(
    ("code", "words"),
    [*((getattr(CODES, name), words) for name, words in ERRORS.items()), (-99, "error code -99")],
)
def test_each_error_code_is_explained_before_the_robots_text(motions, heard, code, words):
    with action(result(GoalStatus.ABORTED, code, "arm_controller")):
        motions.play(f"{OURS}one", "wave", ACTION)
        text = f"{words[0].upper()}{words[1:]}: arm_controller"
        assert heard.ends.get(timeout=PATIENCE_S) == (f"{OURS}one", "failed", text)


def test_every_code_of_the_definition_has_words():
    names = {name for name in dir(CODES) if name.isupper()}
    assert names - {"SUCCEEDED"} == set(ERRORS)


def test_a_goal_keeps_the_robots_spelling_and_its_planning(motions):
    with action() as goals:
        motions.play("two", ODD_NAME, ACTION)
        goal = goals.get(timeout=PATIENCE_S)
    assert (goal.goal_id.id, goal.goal.motion_name) == ("two", ODD_NAME)
    assert goal.goal.skip_planning is False


def test_a_silent_master_removes_no_motion_from_the_list(ros, rosmaster, heard):
    rospy.set_param(f"{ACTION}/motions", {"nod": {"joints": ["a"], "points": [{"positions": [0.5]}]}})
    with spoiling(rosmaster) as master, heard.topics(master.uri) as topics:
        topics.read()
        assert [offer.name for offer in heard.lists.get(timeout=PATIENCE_S)] == ["nod"]
        master.spoiled["getParam"] = CUT_SHORT
        topics.read()
        assert [offer.name for offer in heard.lists.get(timeout=PATIENCE_S)] == ["nod"]
        assert topics.repertoire[ACTION] == {"nod": Motion(("a",), ((0.5,),))}
        del master.spoiled["getParam"]
        rospy.delete_param(f"{ACTION}/motions")
        topics.read()
        assert heard.lists.get(timeout=PATIENCE_S) == []


def test_odd_names_keep_the_robots_spelling_and_points(motions, heard):
    kind, info = service_class("play_motion_msgs/ListMotions"), message_class("play_motion_msgs/MotionInfo")
    described = {
        "joints": ["a"],
        "points": [{"positions": [0.5], "time_from_start": 1.0}],
        "meta": {"name": "<i>Hi</i>"},
    }
    service = rospy.Service(
        f"{ACTION}/list_motions", kind, lambda _: kind._response_class(motions=[info(name=ODD_NAME)])
    )
    rospy.set_param(f"{ACTION}/motions", {ODD_NAME: described, "unlisted": described})
    try:
        motions.read()
        assert heard.lists.get(timeout=PATIENCE_S) == [MotionOffer(ODD_NAME, "<i>Hi</i>", duration_s=1.0)]
        assert motions.look_up(ACTION, ODD_NAME) == (Motion(("a",), ((0.5,),)), False)
        service.shutdown()
        motions.read()
        offers = heard.lists.get(timeout=PATIENCE_S)
        assert {offer.name for offer in offers} == {ODD_NAME, "unlisted"}, "those that have parameters"
    finally:
        service.shutdown()
        rospy.delete_param(f"{ACTION}/motions")


def test_the_list_is_read_when_an_action_server_appears(motions, heard):
    with action():
        heard.lists.get(timeout=PATIENCE_S)
    with action():
        heard.lists.get(timeout=PATIENCE_S)
