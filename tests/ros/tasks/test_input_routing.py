"""The holder redirects input on a real robot: to another velocity topic, another voice, and back."""

from __future__ import annotations

import itertools

import pytest
from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray
from geometry_msgs.msg import Twist

from robots.bridge.ros.inspector.graph import graph
from robots.shared import wire
from robots.shared.configuration.bridge_config import Allowed, Topic
from robots.shared.ros.master import Master
from robots.shared.ros.message_types.classes import message_class
from tests.processes import until
from tests.ros.bridge_support import drivable, running_bridge, tiago_config

TTS, PLAY = "pal_interaction_msgs/TtsAction", "play_motion_msgs/PlayMotionAction"
ALLOWED = (
    Allowed("choose", "/phone_vel", "geometry_msgs/Twist", "drive"),
    Allowed("choose", "/my_vel", "geometry_msgs/Twist", "drive"),  # the robot itself has no such input
    Allowed("choose", "/second_tts", TTS, "speech"),
    Allowed("choose", "/second_play", PLAY, "motions"),
    Allowed("choose", "/third_play", PLAY, "motions"),
    Allowed("choose", "/no_play", PLAY, "motions"),
)
WAIT = {"no_listener", "base_moving"}
_numbers = itertools.count(1)


@pytest.fixture(scope="module")
def robot(ros, simulator):
    return simulator(pose="3.8,2.2,0", seed=1)


@pytest.fixture(scope="module")
def linked(robot, rosmaster, tmp_path_factory):
    folder = tmp_path_factory.mktemp("bridge")
    topics = {"speech": Topic("/tts", TTS), "languages": ["en-GB"], "motions": Topic("/play_motion", PLAY)}
    config = tiago_config(rosmaster, folder, topics=topics, allowed=ALLOWED)
    with running_bridge(config, rosmaster, folder) as (process, hand):
        hand.state_until(drivable, "a robot online")
        yield hand, process.recorded


@pytest.fixture
def talk(linked):
    """A link in control, and the records so far. Control is renewed: it ends after a minute."""
    linked[0].take_control(1)
    return linked


@pytest.fixture
def hand(talk):
    return talk[0]


def choose(hand, use, topic):
    """Choose a topic as soon as the base stands and the bridge's survey lists the topic."""

    def chosen():
        refusal = hand.ask(wire.Choose(1, use, topic, seq=next(_numbers)))
        assert refusal is None or refusal.code in WAIT, refusal
        return refusal is None

    until(chosen, f"{topic} chosen for {use}")
    expected = {use: topic} if topic else {}
    hand.state_until(lambda state: state.chosen == expected, f"chosen: {expected}")


def drives(hand, inbox):
    """Push the stick and return it to the middle; check that its velocities arrive on this topic."""
    hand.stick(0.0)
    hand.state_until(
        lambda state: state.neutral_needed is None and state.phase == "online", "a neutral stick"
    )
    hand.drive_until(0.3, lambda state: state.odometry.vx > 0.0, "motion")
    inbox.until(lambda twist: twist.linear.x > 0.0)
    hand.stick(0.0)
    inbox.until(lambda twist: twist.linear.x == 0.0)


def stood(inbox):
    """True if all new messages on this topic are zeros."""
    return all(twist.linear.x == 0.0 for twist in inbox.drain())


def test_velocities_go_to_the_chosen_input_and_back(ros, talk):
    hand, records = talk
    with ros.listen("/key_vel", Twist) as usual, ros.listen("/phone_vel", Twist) as other:
        ros.connected(usual)
        choose(hand, "drive", "/phone_vel")
        assert "topic.choose drive /key_vel /phone_vel" in records()
        usual.drain()
        drives(hand, other)
        assert stood(usual)
        choose(hand, "drive", None)
        other.drain()
        drives(hand, usual)
        assert stood(other)
        hand.let_go()


def test_a_vanished_chosen_topic_is_reported_and_recorded(ros, talk):
    hand, records = talk
    with ros.listen("/my_vel", Twist):
        choose(hand, "drive", "/my_vel")
        hand.send(wire.LinkSubscribe({"/my_vel": 5.0}))
        hand.until(
            lambda report: isinstance(report, wire.LinkSample) and report.topic == "/my_vel", "/my_vel seen"
        )
    ended = hand.state_until(lambda state: "drive" in state.choice_ended, "its end").choice_ended["drive"]
    assert (ended.topic, ended.to) == ("/my_vel", "/key_vel")
    hand.state_until(lambda state: state.chosen == {} and state.phase == "online", "the default again")
    until(lambda: any("topic.choose gone" in record for record in records()), "a record of it")
    hand.send(wire.LinkSubscribe({}))


def test_a_choice_that_the_robot_lacks_is_refused(hand):
    refused = hand.ask(wire.Choose(1, "motions", "/nowhere", seq=next(_numbers)))
    assert refused.code == "not_allowed"
    refused = hand.ask(wire.Choose(1, "motions", "/no_play", seq=next(_numbers)))
    assert refused.text == "No node on the robot subscribes to /no_play/goal."


def test_a_text_goes_to_the_chosen_voice_until_it_vanishes(ros, hand):
    goal = message_class("pal_interaction_msgs/TtsActionGoal")
    with ros.listen("/second_tts/cancel", GoalID) as cancels:
        with ros.listen("/second_tts/goal", goal) as goals:
            choose(hand, "speech", "/second_tts")
            hand.send(wire.Say(1, "good evening", "en-GB"))
            asked = goals.next()
            assert (asked.goal.rawtext.text, asked.goal.rawtext.lang_id) == ("good evening", "en_GB")
            ended = hand.state_until(lambda state: state.speech_ended, "its end").speech_ended
            assert ended.outcome == "unheard"  # here no server speaks the text
            assert cancels.next().id == asked.goal_id.id
        hand.state_until(lambda state: state.chosen == {}, "the default again")


def offers(hand, condition):
    """Ask for the robot's offers, wait until `condition` is true for them, and return them."""
    hand.send(wire.Refresh())
    return hand.until(lambda report: isinstance(report, wire.Offers) and condition(report), "offers")


def test_motions_are_in_the_robots_words_of_the_chosen_action(ros, hand):
    offered = offers(hand, lambda offers: offers.motions)
    wave = next(offer for offer in offered.motions if offer.name == "wave")
    assert (wave.title, wave.usage, wave.duration_s) == ("Wave", "demo", 5.5)
    chooseable = dict.fromkeys(("/second_play", "/third_play", "/no_play"), "operator")
    assert offered.uses["motions"] == wire.UseOffer("/play_motion", PLAY, chooseable)
    assert offered.languages == ["en-GB"]
    with ros.listen("/second_play/goal", message_class("play_motion_msgs/PlayMotionActionGoal")):
        choose(hand, "motions", "/second_play")
        offers(hand, lambda offers: offers.motions_text == "/second_play offers no motions.")
        choose(hand, "motions", None)
        offers(hand, lambda offers: len(offers.motions) == len(offered.motions))


def test_an_action_of_another_type_is_reported(ros, rosmaster, hand):
    tts = {part: message_class(f"{TTS}{part}") for part in ("Goal", "Result", "Feedback")}
    with (  # in the order of actionlib's servers
        ros.speak("/third_play/status", GoalStatusArray),
        ros.speak("/third_play/result", tts["Result"], listeners=0),
        ros.speak("/third_play/feedback", tts["Feedback"], listeners=0),
        ros.listen("/third_play/goal", tts["Goal"]),
        ros.listen("/third_play/cancel", GoalID),
    ):

        def refusal():
            refusal = hand.ask(wire.Choose(1, "motions", "/third_play", seq=next(_numbers)))
            assert refusal is not None
            return None if refusal.code in WAIT else refusal

        refused = until(refusal, "its type")
        assert (refused.code, refused.figures["found"]) == ("wrong_type", f"{TTS}Goal")
        shown = graph(Master(rosmaster.uri, "/test"), seq=1)
        assert {action.name: action.type for action in shown.actions}["/third_play"] == TTS
        assert {topic.name: topic.type for topic in shown.topics}["/third_play/goal"] == f"{TTS}Goal"


def test_an_old_goal_on_an_unchosen_action_is_cancelled(ros, hand):
    left = GoalStatus(goal_id=GoalID(id="fleet_bridge-left"), status=GoalStatus.ACTIVE)
    with (
        ros.listen("/second_play/cancel", GoalID) as cancels,
        ros.speak("/second_play/status", GoalStatusArray) as statuses,
    ):
        statuses.publish(GoalStatusArray(status_list=[left]))
        assert cancels.next().id == "fleet_bridge-left"


def test_a_robot_whose_master_returns_offers_its_motions_again(make_master, simulator, tmp_path):
    master = make_master()
    simulator(master=master, name="second", pose="2,2,0", seed=1)
    config = tiago_config(master, tmp_path, topics={"motions": Topic("/play_motion", PLAY)})
    with running_bridge(config, master, tmp_path) as (_, hand):
        has_motions = lambda report: isinstance(report, wire.Offers) and report.motions  # noqa: E731
        hand.until(has_motions, "motions")
        master.kill()
        hand.state_until(lambda state: state.phase == "waiting", "no master")
        hand.until(lambda report: not isinstance(report, wire.Offers), "all earlier reports are read")
        master.start()
        hand.until(has_motions, "motions again")
