"""Moves of gripper and torso: rules that need no robot. tests/sides/test_limbs.py tests the other rules."""

import math

import msgspec
import pytest

from robots.bridge.gate.arm.discs import AT_HOME, Posture
from robots.bridge.tasks.goals import OURS
from robots.bridge.tasks.task import Activity
from robots.shared import wire
from robots.shared.configuration.bridge_config import ArmSource, LimbSource, Topic
from robots.shared.geometry.poses import STILL, Velocity
from robots.shared.wire import LimbCancel, MoveLimb
from tests.bridge.support import CONFIG, Bench

GRIPPER = LimbSource("/gripper_controller/follow_joint_trajectory", ["left", "right"], (0.0, 0.045), 0.05)
TORSO = LimbSource("/torso_controller/follow_joint_trajectory", ["lift"], (0.0, 0.35), 0.07)
TOPICS = msgspec.structs.replace(
    CONFIG.topics,
    gripper=GRIPPER,
    torso=TORSO,
    arm=ArmSource({"arm_1_joint": 0.2}, ["arm_1_link", "arm_2_link"]),
    joint_states=Topic("/joint_states", "sensor_msgs/JointState"),
)
OPEN, CLOSE, UP = MoveLimb(1, "gripper", 0.09), MoveLimb(1, "gripper", 0.0), MoveLimb(1, "torso", 0.3)
LEFT = f"{OURS}7-left"  # a goal of an earlier bridge
AWAY = Posture(False, ((0.5, 0.0, 0.1),), (), None)


@pytest.fixture
def bench():
    bench = Bench(config=msgspec.structs.replace(CONFIG, topics=TOPICS)).online().granted()
    bench.base.limbs = {"gripper": 0.04, "torso": 0.15}
    bench.gate.observe_posture = lambda arm, arrival_s: None
    bench.answering = bench.active = True
    home(bench)
    yield bench
    bench.close()


def home(bench, arm=AT_HOME):
    bench.core.posture(arm, bench.now_s)


def passed(bench, seconds, arm=AT_HOME):
    """Let time pass; the arm's posture is known, and the controllers report their newest goals."""
    for _ in range(round(seconds / 0.05)):
        home(bench, arm)
        for limb, goal_id, *_ in bench.base.moves[-1:] if bench.answering else ():
            bench.core.tasks.limbs.move(limb).running({goal_id: bench.active}, bench.now_s)
        bench.core.grant(wire.Grant(1, 60.0, "session-1", "Ann", "ann-id", 1.0), 1, bench.now_s)
        bench.pass_time(0.05)


def moved(bench, order=OPEN):
    """Begin a move; return its goal's id."""
    answers = bench.ask(order)
    bench.recorded()
    passed(bench, 0.1)
    assert answers == [None]
    return bench.base.moves[-1][1]


def ends(bench, goal_id, outcome="succeeded", text="", limb="gripper"):
    bench.core.tasks.limbs.move(limb).ended(goal_id, outcome, text, bench.now_s)


def busy(bench):
    return bench.core.tasks.blocks(Activity.NAVIGATE, bench.now_s)


def state(bench, limb="gripper"):
    return bench.core.state(bench.now_s, []).limbs[limb]


def code(bench, order):
    refusal = bench.order(order)
    return refusal and refusal.code


def test_it_is_sent_only_when_it_is_recorded(bench):
    bench.sink.open.clear()
    answers = bench.ask(OPEN)
    passed(bench, 0.2)
    assert not bench.base.moves and not answers
    bench.sink.open.set()
    bench.recorded()
    passed(bench, 0.1)
    assert answers == [None]
    limb, _, to_m, seconds = bench.base.moves[0]
    assert (limb, to_m, seconds) == ("gripper", 0.09, pytest.approx(1.5 * 0.025 / 0.05))
    assert ("limb.start", {"limb": "gripper", "to_m": 0.09}) in bench.sink.records


def test_a_record_that_fails_moves_nothing(bench):
    bench.sink.fails = "the disk is full"
    answers = bench.ask(OPEN)
    bench.recorded()
    passed(bench, 0.2)
    assert [answer.code for answer in answers] == ["not_recorded"] and not bench.base.moves


def test_joint_states_must_agree_with_the_controller(bench):
    goal_id = moved(bench)
    assert state(bench).to_m == 0.09 and state(bench).who == "Ann"
    bench.base.limbs["gripper"] = 0.085
    ends(bench, goal_id)
    assert (state(bench).ended.outcome, state(bench).to_m) == ("done", None)
    goal_id = moved(bench, CLOSE)
    ends(bench, goal_id)
    assert state(bench).ended.outcome == "not_there" and "0.085 m" in state(bench).ended.text


def test_a_stalled_gripper_may_hold_something(bench):
    goal_id = moved(bench, CLOSE)
    bench.base.limbs["gripper"] = 0.031
    ends(bench, goal_id, "stalled")
    end = state(bench).ended
    assert (end.outcome, end.text) == (
        "stalled",
        "The gripper stopped at 0.031 m. Perhaps it holds something.",
    )
    goal_id = moved(bench, CLOSE)
    bench.base.limbs["gripper"] = 0.002  # the fingers touch each other just before 0.0 m
    ends(bench, goal_id, "stalled")
    assert state(bench).ended.outcome == "done"


@pytest.mark.parametrize("to_m", [-0.01, 0.1, math.nan, math.inf])
def test_a_place_that_the_limb_cannot_reach_is_refused(bench, to_m):
    assert code(bench, MoveLimb(1, "gripper", to_m)) == "out_of_range"


def test_what_is_missing_is_named(bench):
    bench.base.limbs_heard = False
    assert code(bench, OPEN) == "no_listener"
    bench.base.limbs_heard = True
    bench.base.limbs = {}
    assert code(bench, OPEN) == "limb_unknown"


def test_the_torso_of_a_robot_without_an_arm_waits_for_none():
    topics = msgspec.structs.replace(TOPICS, arm=None)
    for gate, refused in (
        (CONFIG.gate, None),
        (msgspec.structs.replace(CONFIG.gate, has_arm=True), "arm_away"),
    ):
        bench = Bench(config=msgspec.structs.replace(CONFIG, topics=topics, gate=gate)).online().granted()
        bench.base.limbs = {"torso": 0.15}
        assert code(bench, UP) == refused
        bench.recorded()
        bench.pass_time(1.0)
        assert len(bench.base.moves) == (refused is None)
        assert refused or bench.core.tasks.limbs.move("torso").in_progress
        bench.close()


def test_a_robot_without_limbs_says_so():
    bench = Bench().online().granted()
    assert (code(bench, OPEN), code(bench, LimbCancel(1, "torso"))) == ("no_limb", "no_move")
    bench.close()


def test_the_base_stands_while_a_limb_moves(bench):
    goal_id = moved(bench)
    assert bench.stick(1.0).code == "limb_moving"
    assert bench.last == STILL
    assert code(bench, wire.DriveBy(1, distance_m=1.0)) == "limb_moving"
    ends(bench, goal_id, "failed")
    assert bench.stick(1.0).code == "neutral_needed"  # the base does not start by itself
    assert bench.stick(0.0) is None


def test_a_limb_does_not_move_while_the_base_does(bench):
    bench.odometry(Velocity(0.3, 0.0, 0.0))
    assert (code(bench, OPEN), code(bench, UP)) == ("base_moving", "base_moving")


def test_the_torso_waits_for_the_arm(bench):
    home(bench, AWAY)
    bench.pass_time(1.0)
    assert code(bench, UP) == "arm_away"
    assert code(bench, OPEN) is None  # the gripper may move at any posture of the arm


def test_the_torso_stops_when_the_arm_leaves_its_home(bench):
    goal_id = moved(bench, UP)
    home(bench, AWAY)
    assert bench.base.cancelled_goals == [goal_id]
    ends(bench, goal_id, "cancelled", limb="torso")
    assert state(bench, "torso").ended.outcome == "arm_away"


def test_the_torso_stops_when_the_arm_is_not_known_any_more(bench):
    moved(bench, UP)
    for _ in range(30):
        bench.pass_time(0.05)
    assert state(bench, "torso").ending or state(bench, "torso").ended.outcome == "arm_away"


@pytest.mark.parametrize(
    ("end", "outcome"),
    [
        (lambda bench: bench.order(LimbCancel(1, "gripper")), "cancelled"),
        (lambda bench: bench.core.stop("Bob", "", bench.now_s), "stopped"),
        (lambda bench: bench.core.revoke(1, "Its slot ended.", bench.now_s), "control_ended"),
    ],
    ids=["cancel", "stop", "end of control"],
)
def test_what_cancels_a_move(bench, end, outcome):
    goal_id = moved(bench)
    end(bench)
    assert bench.base.cancelled_goals == [goal_id]
    ends(bench, goal_id, "cancelled")
    assert state(bench).ended.outcome == outcome
    bench.recorded()
    kind, end_record = bench.sink.records[-1]
    assert (kind, end_record.outcome, end_record.at_m) == ("limb.end", outcome, 0.04)


def test_a_page_that_is_gone_ends_it_after_2_s(bench):
    goal_id = moved(bench)
    bench.core.link_lost(1, bench.now_s)
    for _ in range(60):
        home(bench)
        bench.core.tasks.limbs.move("gripper").running({goal_id: True}, bench.now_s)
        bench.pass_time(0.05)
    assert goal_id in bench.base.cancelled_goals


def test_a_new_request_replaces_the_one_before(bench):
    first = moved(bench)
    answers = bench.ask(CLOSE)
    assert bench.base.cancelled_goals == [first]
    assert state(bench).ended.outcome == "replaced"
    bench.recorded()
    passed(bench, 0.1)
    assert answers == [None] and bench.base.moves[-1][2] == 0.0
    ends(bench, first, "cancelled")  # a late report on the first goal ends nothing
    assert state(bench).to_m == 0.0


def test_a_replaced_request_that_waits_for_its_record_is_answered(bench):
    bench.sink.open.clear()
    first, second = bench.ask(OPEN), bench.ask(CLOSE)
    assert [answer.code for answer in first] == ["replaced"]
    bench.sink.open.set()
    bench.recorded()
    passed(bench, 0.1)
    assert second == [None] and len(bench.base.moves) == 1


def test_a_joint_that_does_not_move_ends_it(bench):
    goal_id = moved(bench, OPEN)
    passed(bench, 3.2)
    assert goal_id in bench.base.cancelled_goals
    ends(bench, goal_id, "cancelled")
    end = state(bench).ended
    assert end.outcome == "no_progress"
    assert end.text == "The gripper stopped at 0.040 m. Perhaps it holds something."


def test_fingers_that_hold_something_keep_their_force(bench):
    goal_id = moved(bench, CLOSE)
    passed(bench, 3.2)
    end = state(bench).ended
    assert (end.outcome, end.text) == (
        "stalled",
        "The gripper stopped at 0.040 m. Perhaps it holds something.",
    )
    assert busy(bench) is None, "it has stood for 3 s"
    passed(bench, 3.0)  # the controller still reports the goal
    assert not bench.base.cancelled_goals and busy(bench) is None
    another = moved(bench, OPEN)
    ends(bench, goal_id, "cancelled")  # the controller replaced it
    ends(bench, another, "cancelled")
    bench.core.tasks.limbs.move("gripper").running({goal_id: True}, bench.now_s)
    assert goal_id in bench.base.cancelled_goals, "nobody waits for it any more"


def left_by_an_earlier_bridge(bench, seconds, active=True, moves_m=0.0):
    """Report a closing goal that this bridge did not send. Return the number of its cancels."""
    for _ in range(round(seconds / 0.2)):
        bench.core.tasks.limbs.move("gripper").running({LEFT: active}, bench.now_s)
        bench.pass_time(0.2)
        if bench.base.limbs:
            bench.base.limbs["gripper"] -= moves_m
    return bench.base.cancelled_goals.count(LEFT)


def test_a_bridge_that_begins_anew_lets_fingers_hold_what_they_hold(bench):
    fingers, bench.base.limbs = bench.base.limbs, {}
    assert not left_by_an_earlier_bridge(bench, 1.0), "joint states arrive a little later"
    bench.base.limbs = fingers
    assert not left_by_an_earlier_bridge(bench, 2.8)
    assert busy(bench).code == "limb_moving", "whether they stand is not known yet"
    assert not left_by_an_earlier_bridge(bench, 1.0)
    assert busy(bench) is None
    moved(bench)
    assert left_by_an_earlier_bridge(bench, 0.2) == 0, "the controller replaces it"
    ends(bench, bench.base.moves[-1][1], "cancelled")
    assert left_by_an_earlier_bridge(bench, 0.2) == 1


@pytest.mark.parametrize(
    ("active", "moves_m", "seconds"), [(False, 0.0, 0.2), (True, 0.002, 0.4)], ids=["not begun", "moving"]
)
def test_a_goal_of_an_earlier_bridge_that_holds_nothing_is_cancelled(bench, active, moves_m, seconds):
    cancels = left_by_an_earlier_bridge(bench, seconds, active, moves_m)
    assert cancels
    assert left_by_an_earlier_bridge(bench, 5.0, active) > cancels + 5


def test_a_bridge_that_is_joined_late_lets_fingers_hold_on(bench):
    fingers, bench.base.limbs = bench.base.limbs, {}
    bench.pass_time(10.0)  # the robot's network was out
    assert not left_by_an_earlier_bridge(bench, 1.0)
    bench.base.limbs = fingers
    assert not left_by_an_earlier_bridge(bench, 4.0)


def test_an_earlier_bridges_goal_of_unseen_fingers_is_cancelled(bench):
    bench.base.limbs = {}
    assert not left_by_an_earlier_bridge(bench, 4.0)
    assert left_by_an_earlier_bridge(bench, 2.0)


def test_a_goal_of_this_bridge_that_is_reported_again_is_cancelled(bench):
    goal_id = moved(bench, CLOSE)
    bench.answering = False
    passed(bench, 2.5)
    assert state(bench).ended.outcome == "unheard"
    cancels = bench.base.cancelled_goals.count(goal_id)
    bench.answering = True
    passed(bench, 4.0)
    assert bench.base.cancelled_goals.count(goal_id) > cancels + 5


def test_a_goal_that_the_controller_has_not_begun_holds_nothing(bench):
    bench.active = False  # a paused controller would later close the fingers unexpectedly
    goal_id = moved(bench, CLOSE)
    passed(bench, 3.2)
    assert goal_id in bench.base.cancelled_goals
    ends(bench, goal_id, "cancelled")
    assert state(bench).ended.outcome == "no_progress"


def test_a_holding_goal_that_somebody_cancels_is_cancelled_further(bench):
    goal_id = moved(bench, CLOSE)
    passed(bench, 3.2)
    assert state(bench).ended.outcome == "stalled" and not bench.base.cancelled_goals
    bench.active = False  # a stop cancelled it, but the controller does not obey
    passed(bench, 1.0)
    assert bench.base.cancelled_goals.count(goal_id) == 2


def test_joint_states_that_end_end_it(bench):
    moved(bench)
    bench.base.limbs = {}
    passed(bench, 1.2)
    assert "joint states ended" in state(bench).ending


def test_a_controller_that_never_answers_is_given_up(bench):
    goal_id = moved(bench)
    bench.answering = False
    passed(bench, 2.5)
    assert goal_id in bench.base.cancelled_goals and state(bench).ended.outcome == "unheard"


def test_the_base_stands_until_an_unheard_limb_stands(bench):
    moved(bench)
    bench.answering = False
    for step in range(8):
        bench.base.limbs["gripper"] = 0.04 + 0.002 * step
        passed(bench, 0.5)
    assert state(bench).ended.outcome == "unheard"
    assert busy(bench).code == "limb_moving"
    bench.base.limbs["gripper"] = None  # the position is unknown: the gripper may move
    passed(bench, 3.0)
    assert busy(bench).code == "limb_moving"
    bench.base.limbs["gripper"] = 0.06
    passed(bench, 1.5)
    assert busy(bench) is None


def test_the_base_crawls_past_a_limb_without_joint_states(bench):
    moved(bench)
    bench.answering = False
    bench.base.limbs = {}
    passed(bench, 4.5)
    assert state(bench).ended.outcome in {"unheard", "not_watched"}
    assert bench.stick(0.5).code == "limb_moving"
    bench.stick(0.0)
    passed(bench, 3.0)
    assert bench.gate.lost_limb == "gripper"
    assert bench.stick(0.5) is None
    bench.stick(0.0)
    bench.pass_time(2.0)
    assert busy(bench).code == "limb_moving", "no motion begins"
    assert code(bench, wire.Go(1, 1.0, 0.0, 0.0)) == "limb_moving", "nobody holds navigation to a crawl"
    bench.base.limbs = {"gripper": 0.06, "torso": 0.15}
    passed(bench, 2.0)
    assert bench.gate.lost_limb is None and busy(bench) is None


def test_the_base_crawls_past_a_lost_limb_with_a_reported_goal(bench):
    goal_id = moved(bench)
    bench.base.limbs = {}
    passed(bench, 5.5)
    assert bench.stick(0.5).code == "limb_moving", "the controller has 5 s to obey"
    bench.stick(0.0)
    passed(bench, 1.5)
    assert state(bench).ended.outcome == "not_watched"
    passed(bench, 5.0)
    assert bench.base.cancelled_goals[-1] == goal_id
    assert bench.gate.lost_limb == "gripper" and bench.stick(0.5) is None
    bench.stick(0.0)
    bench.pass_time(2.0)
    assert busy(bench).code == "limb_moving", "no motion begins"
    bench.base.limbs = {"gripper": 0.06, "torso": 0.15}
    passed(bench, 2.0)
    assert bench.gate.lost_limb is None
    assert bench.stick(0.5).code == "limb_moving", "the controller still reports it"
    bench.answering = False
    passed(bench, 3.0)
    assert busy(bench) is None


def test_a_limb_of_an_earlier_bridge_that_is_never_seen_is_lost(bench):
    bench.base.limbs = {}
    bench.pass_time(1.0)
    for _ in range(70):
        bench.core.tasks.limbs.move("torso").running({LEFT: True}, bench.now_s)
        bench.pass_time(0.1)
    assert bench.gate.lost_limb == "torso"


def test_the_base_crawls_past_two_lost_limbs(bench):
    moved(bench)
    moved(bench, UP)
    bench.answering = False
    bench.base.limbs = {}
    passed(bench, 9.0)
    assert busy(bench).code == "limb_moving"
    assert bench.gate.lost_limb and bench.stick(0.5) is None


def test_a_disobedient_controller_is_given_up_when_the_limb_stands(bench):
    goal_id = moved(bench)
    bench.order(LimbCancel(1, "gripper"))
    for step in range(10):  # the gripper still moves: the base waits
        bench.base.limbs["gripper"] = 0.04 + 0.002 * step
        passed(bench, 1.0)
    assert state(bench).to_m == 0.09
    passed(bench, 5.2)
    assert state(bench).ended.outcome == "cancelled"
    cancels = bench.base.cancelled_goals.count(goal_id)
    passed(bench, 1.0)
    assert bench.base.cancelled_goals.count(goal_id) > cancels  # no move watches this goal now


def test_another_node_that_takes_the_limb_over_is_named(bench):
    goal_id = moved(bench)
    ends(bench, goal_id, "cancelled")
    assert state(bench).ended.outcome == "taken_over"


def test_a_limb_that_others_move_is_busy(bench):
    bench.core.tasks.limbs.move("gripper").running({"moveit-1": True}, bench.now_s)
    assert code(bench, OPEN) == "limb_busy"


def test_a_motion_excludes_it_and_it_excludes_a_motion(bench):
    bench.core.tasks.motions.running("/play_motion", ["other-1"], bench.now_s)
    assert code(bench, OPEN) == "motion_running"
    bench.core.tasks.motions.running("/play_motion", [], bench.now_s)
    moved(bench)
    bench.core.tasks.routing.surveyed({"/play_motion/goal": "play_motion_msgs/PlayMotionActionGoal"}, 0.0)
    assert code(bench, wire.Play(1, "wave")) == "limb_moving"
