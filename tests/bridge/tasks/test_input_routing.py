"""Input routing: to allow-listed topics of the right type, once the base stands, until control ends."""

import msgspec
import pytest

from robots.bridge.tasks.input_routing import PARTING_S, PATIENCE_S
from robots.shared import wire
from robots.shared.configuration.bridge_config import Allowed, ArmSource, Topic
from robots.shared.geometry.poses import STILL, Velocity
from tests.bridge.support import CONFIG, Bench, Outcome, settled

TTS, PLAY, TWIST = (
    "pal_interaction_msgs/TtsAction",
    "play_motion_msgs/PlayMotionAction",
    "geometry_msgs/Twist",
)
ALLOWED = (
    Allowed("choose", "/phone_vel", TWIST, "drive"),
    Allowed("choose", "/nav_vel", TWIST, "drive", role="supervisor"),
    Allowed("choose", "/second_tts", TTS, "speech"),
    Allowed("choose", "/second_play", PLAY, "motions"),
    Allowed("publish", "/notes", "std_msgs/String"),
    Allowed("call", "/third_tts", TTS, "speech"),  # a service takes no input
)
LISTENED = {
    "/key_vel": TWIST,
    "/phone_vel": TWIST,
    "/nav_vel": "geometry_msgs/TwistStamped",
    "/tts/goal": f"{TTS}Goal",
    "/second_tts/goal": f"{TTS}Goal",
    "/play_motion/goal": f"{PLAY}Goal",
    "/second_play/goal": f"{PLAY}Goal",
}


@pytest.fixture
def bench():
    bench = Bench(config=msgspec.structs.replace(CONFIG, allowed=ALLOWED)).online()
    bench.core.tasks.routing.surveyed(LISTENED, bench.now_s)
    bench.base.sweeps = {"nod": ()}
    bench.granted().pass_time(0.3)
    return bench


def ask(bench, use, topic, fence=1):
    """Send the choice; return its answers so far."""
    return bench.ask(wire.Choose(fence, use, topic))


def connects(bench):
    """Report that the topics requested last are connected."""
    use, topics = bench.base.attended[-1]
    bench.core.tasks.routing.attended(use, topics, bench.now_s)


def choose(bench, use, topic):
    answers = ask(bench, use, topic)
    settled(bench)
    if not answers:
        connects(bench)
    assert answers == [None]


def chosen(bench):
    return bench.core.state(bench.now_s, []).chosen


def test_chosen_topic_is_recorded_then_connected_then_used(bench):
    bench.sink.open.clear()
    answers = ask(bench, "speech", "/second_tts")
    bench.core.tick(bench.now_s)
    assert bench.base.attended == []
    bench.sink.open.set()
    settled(bench)
    assert bench.base.attended == [("speech", {"/tts", "/second_tts"})]
    assert (answers, chosen(bench)) == ([], {})
    connects(bench)
    assert (answers, chosen(bench)) == ([None], {"speech": "/second_tts"})
    bench.recorded()
    assert bench.sink.records == [
        ("topic.choose", {"use": "speech", "from": "/tts", "to": "/second_tts"}),
        ("topic.choose", Outcome("chosen", use="speech", to="/second_tts")),
    ]
    bench.order(wire.Say(1, "hola", "es-ES"))
    settled(bench)
    assert bench.base.said[-1][1].topic == "/second_tts"


def test_chosen_action_performs_and_cancels_the_motion(bench):
    choose(bench, "motions", "/second_play")
    assert bench.order(wire.Play(1, "nod")) is None
    settled(bench)
    assert bench.sink.records[-1] == ("motion.start", {"motion": "nod", "topic": "/second_play"})
    bench.core.revoke(1, "over", bench.now_s)
    bench.core.tick(bench.now_s)
    assert chosen(bench) == {}
    [(goal_id, _)] = bench.base.played
    assert bench.base.cancelled_goals == [goal_id]


def test_every_allowed_motion_action_is_subscribed_always(bench):
    """Motions left by an earlier bridge, or given up by this one, must be observed."""
    both = {"/play_motion", "/second_play"}
    assert bench.core.tasks.routing.connected("motions") == both
    choose(bench, "motions", "/second_play")
    bench.order(wire.Play(1, "nod"))
    settled(bench)
    bench.pass_time(2.2)
    bench.recorded()
    assert bench.sink.records[-1][1].outcome == "unheard"
    bench.core.revoke(1, "over", bench.now_s)
    bench.core.tick(bench.now_s)
    assert chosen(bench) == {}
    assert bench.core.tasks.routing.connected("motions") == both
    assert "motions" not in dict(bench.base.attended)  # the connected actions never changed


def test_motions_are_read_again_after_each_change_of_action(bench):
    choose(bench, "motions", "/second_play")
    assert bench.base.readings == 1
    bench.core.revoke(1, "over", bench.now_s)
    assert bench.base.readings == 2


def test_old_drive_topic_gets_zero_before_the_new_one_is_used(bench):
    choose(bench, "drive", "/phone_vel")
    [(topic, sent)] = bench.base.switched
    assert topic == "/phone_vel"
    assert bench.base.sent[sent - 1] == STILL
    needed = bench.core.state(bench.now_s, []).neutral_needed
    assert (needed.code, needed.text) == ("input_moved", "input goes to /phone_vel now")
    assert bench.stick(0.5).code == "neutral_needed"
    bench.stick(0.0)
    bench.driving()


@pytest.mark.parametrize(
    ("use", "topic", "code"),
    [
        ("drive", "/mobile_base_controller/cmd_vel", "not_allowed"),
        ("drive", "/second_tts", "not_allowed"),
        ("speech", "/notes", "not_allowed"),
        ("speech", "/third_tts", "not_allowed"),
        ("drive", "/nav_vel", "wrong_type"),
    ],
)
def test_forbidden_choice_is_refused_and_not_recorded(bench, use, topic, code):
    [refusal] = ask(bench, use, topic)
    assert refusal.code == code
    settled(bench)
    assert bench.sink.kinds == []
    assert bench.base.attended == []


def test_a_topic_without_subscribers_is_refused(bench):
    bench.core.tasks.routing.surveyed(LISTENED | {"/phone_vel": "x/Y"}, bench.now_s)
    [refusal] = ask(bench, "drive", "/phone_vel")
    assert refusal.text == "/phone_vel has type x/Y on the robot, but geometry_msgs/Twist is needed."
    bench.core.tasks.routing.surveyed({}, bench.now_s)
    [refusal] = ask(bench, "motions", "/second_play")
    assert (refusal.code, refusal.text) == (
        "no_listener",
        "No node on the robot subscribes to /second_play/goal.",
    )


@pytest.mark.parametrize(
    ("spoil", "code"),
    [
        (lambda bench: bench.core.stop("Bob", "", bench.now_s), "stopped"),
        (lambda bench: bench.driving(), "base_moving"),
        (lambda bench: bench.odometry(Velocity(0.1, 0.0, 0.0)), "base_moving"),
        (lambda bench: bench.core.revoke(1, "over", bench.now_s), "no_lease"),
    ],
)
def test_drive_topic_changes_only_while_the_base_stands(bench, spoil, code):
    spoil(bench)
    [refusal] = ask(bench, "drive", "/phone_vel")
    assert refusal.code == code
    assert bench.base.switched == []


@pytest.mark.parametrize(
    ("spoil", "code"),
    [
        (lambda bench: bench.core.stop("Bob", "", bench.now_s), "stopped"),
        (lambda bench: bench.odometry(Velocity(0.1, 0.0, 0.0)), "base_moving"),
        (lambda bench: bench.core.revoke(1, "over", bench.now_s), "no_lease"),
    ],
)
@pytest.mark.parametrize("stage", ["recording", "connecting"])
def test_event_before_the_record_prevents_the_choice(bench, spoil, code, stage):
    answers = ask(bench, "drive", "/phone_vel")
    if stage == "connecting":
        settled(bench)
    spoil(bench)
    settled(bench)
    if stage == "connecting":
        bench.core.tasks.routing.attended("drive", {"/key_vel", "/phone_vel"}, bench.now_s)
    assert [refusal.code for refusal in answers] == [code]
    assert (bench.base.switched, chosen(bench)) == ([], {})


def test_a_choice_that_cannot_be_recorded_is_not_made(bench):
    bench.sink.fails = "disk full"
    answers = ask(bench, "speech", "/second_tts")
    settled(bench)
    assert [refusal.code for refusal in answers] == ["not_recorded"]
    assert bench.base.attended == []


def test_denied_topic_is_refused_though_the_allow_list_has_it(bench):
    joystick = Allowed("choose", "/joy_vel", TWIST, "drive")
    bench = Bench(config=msgspec.structs.replace(CONFIG, allowed=(joystick,))).online().granted()
    bench.pass_time(0.3)
    [refusal] = ask(bench, "drive", "/joy_vel")
    assert refusal.code == "not_allowed"
    assert bench.core.tasks.capabilities.now().uses["drive"].chooseable == {}


def test_other_action_is_refused_if_only_default_reports_the_arm():
    arm = ArmSource(home={"arm": 0.0}, links=[], postures={"offer": [(0.6, 0.0, 0.2)]})
    topics = msgspec.structs.replace(CONFIG.topics, arm=arm)
    bench = Bench(config=msgspec.structs.replace(CONFIG, topics=topics, allowed=ALLOWED)).online().granted()
    [refusal] = ask(bench, "motions", "/second_play")
    assert refusal.code == "not_allowed"


def test_the_newest_of_two_choices_counts_and_both_are_answered(bench):
    first, second = ask(bench, "drive", "/phone_vel"), ask(bench, "drive", "/phone_vel")
    assert [refusal.code for refusal in first] == ["overtaken"]
    settled(bench)
    connects(bench)
    assert second == [None]


def test_dropped_topic_is_not_taken_as_connected(bench):
    ask(bench, "speech", "/second_tts")
    settled(bench)
    bench.core.revoke(1, "over", bench.now_s)
    bench.core.tick(bench.now_s)
    bench.granted(2)
    answers = ask(bench, "speech", "/second_tts", fence=2)
    settled(bench)
    both, usual, again = bench.base.attended
    bench.core.tasks.routing.attended(*both, bench.now_s)
    bench.core.tasks.routing.attended(*usual, bench.now_s)
    assert answers == []
    bench.core.tasks.routing.attended(*again, bench.now_s)
    assert answers == [None]


def test_topic_not_connected_in_time_may_be_chosen_again(bench):
    answers = ask(bench, "drive", "/phone_vel")
    bench.pass_time(PATIENCE_S + 0.1)
    assert [refusal.code for refusal in answers] == ["robot_silent"]
    asked, let_go = bench.base.attended
    bench.core.tasks.routing.attended(*asked, bench.now_s)
    bench.core.tasks.routing.attended(*let_go, bench.now_s)
    assert (len(answers), chosen(bench), bench.base.switched) == (1, {}, [])
    choose(bench, "drive", "/phone_vel")


def test_failed_connection_does_not_block_later_choices(bench):
    choose(bench, "speech", "/second_tts")
    answers = ask(bench, "drive", "/phone_vel")
    settled(bench)
    bench.core.tasks.routing.attended("drive", None, bench.now_s)
    bench.pass_time(PATIENCE_S + 0.1)
    assert [refusal.code for refusal in answers] == ["robot_silent"]
    assert bench.core.tasks.routing.connected("drive") == {"/key_vel"}
    connects(bench)
    choose(bench, "drive", "/phone_vel")


def test_return_to_default_works_without_subscribers(bench):
    choose(bench, "speech", "/second_tts")
    bench.core.tasks.routing.surveyed({"/second_tts/goal": f"{TTS}Goal"}, bench.now_s)
    answers = ask(bench, "speech", None)
    settled(bench)
    assert (answers, chosen(bench)) == ([None], {})  # the default is still connected
    bench.core.tick(bench.now_s)
    assert bench.base.attended[-1] == ("speech", {"/tts"})


def test_present_choice_may_be_chosen_again(bench):
    choose(bench, "drive", "/key_vel")
    choose(bench, "drive", None)
    assert (bench.sink.kinds, bench.base.switched) == ([], [])


def test_lost_chosen_topic_halts_the_base_and_restores_default(bench):
    choose(bench, "drive", "/phone_vel")
    bench.stick(0.0)
    bench.driving()
    left = {name: kind for name, kind in LISTENED.items() if name != "/phone_vel"}
    bench.core.tasks.routing.surveyed(left, bench.now_s)
    topic, sent = bench.base.switched[-1]
    assert (topic, bench.base.sent[sent - 1]) == ("/key_vel", STILL)
    state = bench.core.state(bench.now_s, [])
    assert state.chosen == {}
    assert state.neutral_needed.text == "/phone_vel has no subscriber any more: input goes to /key_vel again"


def test_choices_end_with_control_and_rolling_base_gets_zeros(bench):
    choose(bench, "speech", "/second_tts")
    choose(bench, "drive", "/phone_vel")
    bench.stick(0.0)
    bench.driving()
    bench.odometry(Velocity(0.3, 0.0, 0.0))
    bench.core.revoke(1, "over", bench.now_s)
    bench.pass_time(0.2)
    assert chosen(bench) == {"drive": "/phone_vel"}
    assert bench.last == STILL
    bench.odometry(STILL)
    bench.pass_time(0.4)
    assert chosen(bench) == {}
    assert [topic for topic, _ in bench.base.switched] == ["/phone_vel", "/key_vel"]


def test_base_without_odometry_gets_zeros_for_limited_time(bench):
    choose(bench, "drive", "/phone_vel")
    bench.odometry(Velocity(0.3, 0.0, 0.0))
    bench.core.revoke(1, "over", bench.now_s)
    bench.pass_time(PARTING_S + 0.2)
    assert chosen(bench) == {}


def test_pages_get_the_possible_choices(bench):
    offers = bench.core.tasks.capabilities.now()
    assert offers.uses["drive"] == wire.UseOffer(
        "/key_vel", TWIST, {"/phone_vel": "operator", "/nav_vel": "supervisor"}
    )
    assert offers.uses["speech"] == wire.UseOffer("/tts", TTS, {"/second_tts": "operator"})
    assert offers.languages == ["en-GB", "es-ES"]
    assert offers.publishable == {"/notes": "std_msgs/String"}


SAY, STAMPED = "communication_skills/action/Say", "geometry_msgs/TwistStamped"


@pytest.mark.parametrize(
    ("there", "topic", "says"),
    [
        ({"/tts/goal": f"{TTS}Goal", "/say/goal": f"{SAY}Goal"}, "/tts", None),
        ({"/say/goal": f"{SAY}Goal"}, "/say", None),
        ({"/say/goal": f"{TTS}Goal"}, "/tts", "No node on the robot subscribes to /tts/goal."),
        (
            {"/say/goal": f"{SAY}Goal", "/skill/say/goal": f"{SAY}Goal"},
            "/tts",
            "The robot has no /tts, but /say, /skill/say: enter one of them in its profile.",
        ),
    ],
)
def test_another_name_of_the_right_type_is_used_if_it_is_the_only_one(there, topic, says):
    others = (Topic("/say", SAY), Topic("/skill/say", SAY))
    topics = msgspec.structs.replace(CONFIG.topics, speech=Topic("/tts", TTS, others))
    bench = Bench(config=msgspec.structs.replace(CONFIG, topics=topics)).online()
    bench.core.tasks.routing.surveyed(there, bench.now_s)
    bench.granted().pass_time(0.3)
    offer = bench.core.tasks.capabilities.now().uses["speech"]
    assert (offer.topic, offer.refusal and offer.refusal.sentence) == (topic, says)
    if says is None:
        assert ("speech", frozenset({topic})) in bench.base.attended or topic == "/tts"


def test_velocities_have_the_type_of_their_listener():
    drive = msgspec.structs.replace(CONFIG.topics.drive, others=(Topic("/key_vel", STAMPED),))
    topics = msgspec.structs.replace(CONFIG.topics, drive=drive)
    bench = Bench(config=msgspec.structs.replace(CONFIG, topics=topics)).online()
    bench.core.tasks.routing.surveyed({"/key_vel": STAMPED}, bench.now_s)
    assert bench.core.tasks.capabilities.now().uses["drive"] == wire.UseOffer("/key_vel", STAMPED, {})
    bench.core.tasks.routing.surveyed({"/key_vel": TWIST}, bench.now_s)
    assert bench.core.tasks.capabilities.now().uses["drive"].type == TWIST


def test_pages_see_choices_without_subscriber(bench):
    def refused(use):
        refusal = reported_offers(bench)[-1].uses[use].refusal
        return refusal and refusal.code

    bench.core.tasks.routing.surveyed({**LISTENED, "/tts/goal": f"{PLAY}Goal"}, bench.now_s)
    bench.core.tick(bench.now_s)
    assert [refused(use) for use in ("speech", "motions")] == ["wrong_type", None]
    choose(bench, "speech", "/second_tts")
    bench.core.tick(bench.now_s)
    assert refused("speech") is None
    bench.core.tasks.routing.surveyed({"/key_vel": TWIST}, bench.now_s)
    bench.core.tick(bench.now_s)
    assert [refused(use) for use in ("drive", "speech", "motions")] == [None, "no_listener", "no_listener"]


# --- capabilities ---------------------------------------------------------------------------------

NOD = wire.MotionOffer("nod", "Nod", "demo", "", 1.5)


def reported_offers(bench):
    return [report for report in bench.notices if isinstance(report, wire.Offers)]


def test_motions_are_reported_on_change_and_on_request(bench):
    read = bench.core.tasks.capabilities.read
    assert bench.core.tasks.capabilities.now().motions_text == "The robot’s motions have not been read yet."
    read("/play_motion", [NOD], "")
    read("/play_motion", [NOD], "")
    assert [offers.motions for offers in reported_offers(bench)] == [[NOD]]
    bench.core.tasks.refresh()
    assert bench.base.readings == 1
    read("/play_motion", [NOD], "")
    assert len(reported_offers(bench)) == 2
    read("/play_motion", [], "/play_motion offers no motions.")
    assert reported_offers(bench)[-1].motions_text == "/play_motion offers no motions."


def test_motions_are_those_of_the_chosen_action(bench):
    bench.core.tasks.capabilities.read("/play_motion", [NOD], "")
    wave = wire.MotionOffer("wave", "Wave")
    choose(bench, "motions", "/second_play")
    bench.core.tasks.capabilities.read("/second_play", [wave], "")
    assert reported_offers(bench)[-1].motions == [wave]
    choose(bench, "motions", None)
    bench.core.tick(bench.now_s)
    assert reported_offers(bench)[-1].motions == [NOD]


def test_a_robot_without_motions_says_so_when_asked():
    topics = msgspec.structs.replace(CONFIG.topics, motions=None, speech=None)
    bench = Bench(config=msgspec.structs.replace(CONFIG, topics=topics))
    bench.core.tasks.refresh()
    [offers] = reported_offers(bench)
    assert (offers.motions_text, offers.languages) == ("This robot has no recorded motions.", [])
    assert list(offers.uses) == ["drive"]
