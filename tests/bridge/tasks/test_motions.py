"""Recorded motions: only the holder starts them, with a record and arm clearance; they end with control."""

import pytest

from robots.bridge.gate.values import SensorHealth
from robots.bridge.tasks.motions import offered, recorded
from robots.bridge.tasks.named_ends import NAMED_S
from robots.shared import wire
from robots.shared.geometry.poses import STILL, Velocity
from tests.bridge.support import Bench, Outcome, runs_out, settled

AHEAD = ((0.6, 0.0, 0.2),)


@pytest.fixture
def bench():
    bench = Bench().online()
    bench.base.sweeps = {"wave": AHEAD, "nod": ()}
    bench.granted().pass_time(0.3)
    return bench


def ask(bench, motion="wave", fence=1, link=1):
    return bench.order(wire.Play(fence, motion), link)


def begun(bench, motion="wave"):
    """Start the motion; return the id of its goal."""
    assert ask(bench, motion) is None
    settled(bench)
    goal_id, played = bench.base.played[-1]
    assert played == motion
    bench.core.tasks.motions.running("/play_motion", [goal_id], bench.now_s)
    return goal_id


def denied(bench, motion="wave"):
    """Return why the motion was not started, from its recorded outcome; the robot got no request."""
    answers = bench.ask(wire.Play(1, motion))
    settled(bench)
    bench.recorded()
    [refusal] = answers
    assert [kind for kind, _ in bench.sink.records[-2:]] == ["motion.start", "motion.end"]
    end = bench.sink.records[-1][1]
    assert (end.outcome, end.text) == (refusal.code, refusal.text)
    assert bench.base.played == []
    state = bench.core.state(bench.now_s, [])
    assert (state.motion, state.motion_ended) == (None, None)
    return refusal


def passes(bench, goal_id, seconds):
    """Let time pass; the robot reports the goal."""
    for _ in range(round(seconds / 0.1)):
        bench.core.tasks.motions.running("/play_motion", [goal_id], bench.now_s)
        bench.pass_time(0.1)


def ends(bench, goal_id, outcome="cancelled", text=""):
    bench.core.tasks.motions.ended(goal_id, outcome, text, bench.now_s)
    bench.recorded()
    kind, end = bench.sink.records[-1]
    assert kind == "motion.end"
    return end


def test_goal_is_sent_after_its_record_and_its_end_is_recorded(bench):
    bench.sink.open.clear()
    assert ask(bench) is None
    bench.core.tick(bench.now_s)
    assert bench.base.played == []
    bench.sink.open.set()
    settled(bench)
    [(goal_id, motion)] = bench.base.played
    assert motion == "wave"
    passes(bench, goal_id, 3.0)
    end = ends(bench, goal_id, "succeeded")
    assert (end.motion, end.outcome) == ("wave", "succeeded")
    assert end.duration_s == pytest.approx(3.0, abs=0.1)
    assert bench.sink.kinds == ["motion.start", "motion.end"]
    assert bench.base.cancelled_goals == []


def test_unrecorded_motion_is_not_performed(bench):
    bench.sink.fails = "disk full"
    answers = bench.ask(wire.Play(1, "wave"))
    settled(bench)
    assert bench.base.played == []
    assert [refusal.code for refusal in answers] == ["not_recorded"]


def test_motion_stopped_before_its_start_keeps_that_refusal(bench):
    bench.sink.open.clear()
    answers = bench.ask(wire.Play(1, "wave"))
    bench.core.stop("Bob", "", bench.now_s)
    bench.pass_time(2.3)  # long enough for `not_recorded`
    bench.sink.open.set()
    settled(bench)
    assert [refusal.code for refusal in answers] == ["stopped"]
    assert [end.outcome for kind, end in bench.sink.records if kind == "motion.end"] == ["stopped"]


def test_motion_cancelled_before_its_start_is_not_accepted(bench):
    bench.sink.open.clear()
    answers = bench.ask(wire.Play(1, "wave"))
    bench.order(wire.PlayCancel(1))
    bench.sink.open.set()
    settled(bench)
    assert [(refusal.code, refusal.text) for refusal in answers] == [
        ("cancelled", "Its holder cancelled it.")
    ]


def test_unrecorded_motion_is_refused_before_its_points_arrive(bench):
    bench.base.asked = []
    bench.sink.fails = "disk full"
    answers = bench.ask(wire.Play(1, "wave"))
    settled(bench)
    assert [refusal.code for refusal in answers] == ["not_recorded"]


@pytest.mark.parametrize(
    ("spoil", "code"),
    [
        (lambda bench: bench.core.revoke(1, "over", bench.now_s), "no_lease"),
        (lambda bench: bench.core.stop("Bob", "", bench.now_s), "stopped"),
        (
            lambda bench: bench.core.tasks.motions.running("/play_motion", ["other"], bench.now_s),
            "motion_running",
        ),
        (lambda bench: setattr(bench.base, "listeners", 0), "robot_offline"),
        (lambda bench: bench.driving(), "base_moving"),
    ],
)
def test_a_forbidden_motion_is_refused_and_not_recorded(bench, spoil, code):
    spoil(bench)
    assert ask(bench).code == code
    settled(bench)
    assert bench.base.played == []
    assert "motion.start" not in bench.sink.kinds


@pytest.mark.parametrize(
    ("spoil", "code"),
    [
        (lambda bench: bench.gate.seen.append((0.6, 0.1)), "motion_blocked"),
        (lambda bench: bench.base.sweeps.clear(), "unknown_motion"),
    ],
)
def test_motion_refused_for_its_points_is_recorded_with_reason(bench, spoil, code):
    spoil(bench)
    assert denied(bench).code == code


def test_a_base_that_still_rolls_is_moving(bench):
    bench.odometry(Velocity(0.1, 0.0, 0.0))
    assert ask(bench).code == "base_moving"


def test_base_without_recent_odometry_is_not_said_to_drive(bench):
    bench.now_s += 0.8
    refusal = ask(bench)
    assert refusal.code == "base_moving"
    assert refusal.text == "It is unknown whether the robot stands still: its odometry is late."


def test_only_the_holder_is_obeyed(bench):
    assert ask(bench, fence=2).code == "unknown_fence"
    assert ask(bench, link=5).code == "other_link"


def test_a_refusal_for_want_of_room_says_where(bench):
    bench.gate.seen = [(0.5, 0.12), (0.6, 0.1), (2.0, 0.0)]
    refusal = denied(bench)
    assert refusal.rule == "gate"
    assert refusal.figures == {"sensor": "laser", "distance_m": 0.24, "side": "ahead"}
    assert refusal.text == "An obstacle is in the arm’s way: laser, 0.2 m ahead."


@pytest.mark.parametrize("kind", ["scan", "depth"])
def test_an_arm_does_not_move_without_sensors_watching(bench, kind):
    bench.gate.health = [SensorHealth("eye", kind, False, None, "nothing has come yet")]
    refusal = denied(bench)
    assert refusal.code == "not_watched"
    assert refusal.text == "Obstacles around the arm are unknown: eye: nothing has come yet."
    begun(bench, "nod")  # this motion does not move the arm


def test_a_laser_that_falls_silent_cancels_it(bench):
    goal_id = begun(bench)
    bench.gate.health = [SensorHealth("depth", "depth", False, 0.6, "nothing new for 0.6 s")]
    bench.pass_time(0.05)
    assert bench.base.cancelled_goals == []  # the camera may see the arm, or move with it
    bench.gate.health = [SensorHealth("laser", "scan", False, 0.3, "nothing new for 0.3 s")]
    bench.pass_time(0.05)
    assert bench.base.cancelled_goals == [goal_id]
    assert ends(bench, goal_id).outcome == "not_watched"


def test_obstacles_outside_the_arms_space_do_not_matter(bench):
    bench.gate.seen = [(-0.6, 0.0), (1.5, 0.0)]
    ends(bench, begun(bench), "succeeded")
    bench.gate.seen = [(0.6, 0.0)]
    begun(bench, "nod")


def test_second_motion_is_refused_naming_the_first(bench):
    begun(bench)
    refusal = ask(bench, "nod")
    assert refusal.code == "motion_running"
    assert refusal.figures == {"motion": "wave", "who": "Ann"}


def test_a_motion_is_called_by_the_name_that_people_read(bench):
    bench.core.tasks.capabilities.read("/play_motion", [wire.MotionOffer("wave", "Wave the hand")], "")
    begun(bench)
    refusal = ask(bench, "nod")
    assert refusal.text == "The robot performs “Wave the hand”, requested by Ann."
    assert refusal.figures == {"motion": "wave", "who": "Ann"}
    assert bench.core.tasks.under_way == ["the motion “Wave the hand”"]


def test_repeated_end_report_counts_once(bench):
    goal_id = begun(bench)
    ends(bench, goal_id, "succeeded")
    bench.core.tasks.motions.ended(goal_id, "failed", "", bench.now_s)
    bench.recorded()
    assert bench.sink.kinds == ["motion.start", "motion.end"]
    assert bench.core.state(bench.now_s, []).motion_ended.outcome == "succeeded"


def test_base_stands_during_a_motion_and_needs_neutral_after(bench):
    goal_id = begun(bench)
    assert bench.stick(0.5).code == "motion_running"
    assert bench.last == STILL
    text = "nothing drives during a motion"  # true during the motion and after it
    assert bench.core.state(bench.now_s, []).neutral_needed.text == text
    ends(bench, goal_id, "succeeded")
    assert bench.stick(0.5).code == "neutral_needed"
    assert bench.core.state(bench.now_s, []).neutral_needed.text == text
    bench.stick(0.0)
    bench.driving()


def test_intruder_cancels_the_motion_and_it_does_not_resume(bench):
    goal_id = begun(bench)
    bench.gate.seen = [(0.6, 0.0)]
    bench.pass_time(0.05)
    assert bench.base.cancelled_goals == [goal_id]
    end = ends(bench, goal_id)
    assert end.outcome == "intruder"
    assert "laser, 0.3 m ahead" in end.text
    bench.gate.seen = []
    bench.pass_time(1.0)
    assert len(bench.base.played) == 1
    state = bench.core.state(bench.now_s, [])
    assert state.motion is None
    assert state.motion_ended.outcome == "intruder"


def test_depth_points_away_from_the_arm_cancel_a_motion(bench):
    bench.base.lies = ((0.7, 0.0, 0.09),)
    goal_id = begun(bench)
    bench.gate.pictured = [(0.7, 0.05)]
    bench.pass_time(0.5)
    assert bench.base.cancelled_goals == []
    bench.gate.pictured = [(0.7, 0.05), (0.5, -0.1)]
    bench.pass_time(0.05)
    assert bench.base.cancelled_goals == [goal_id]
    end = ends(bench, goal_id)
    assert end.outcome == "intruder"
    assert "depth, 0.2 m ahead" in end.text


def test_depth_points_without_joint_states_cancel_nothing(bench):
    goal_id = begun(bench)
    bench.gate.pictured = [(0.5, -0.1)]
    bench.pass_time(0.5)
    assert bench.base.cancelled_goals == []
    bench.gate.seen = [(0.5, -0.1)]
    bench.pass_time(0.05)
    assert bench.base.cancelled_goals == [goal_id]


def test_motion_is_judged_by_its_present_points(bench):
    bench.base.asked = []
    bench.gate.seen = [(-0.6, 0.0)]
    answers = bench.ask(wire.Play(1, "wave"))
    bench.pass_time(0.1)
    assert bench.sink.kinds == ["motion.start"]
    assert (answers, bench.base.played) == ([], [])
    bench.base.sweeps["wave"] = ((-0.6, 0.0, 0.2),)  # somebody recorded the motion again
    bench.base.asked.pop()()
    assert [refusal.code for refusal in answers] == ["motion_blocked"]
    assert bench.base.played == []


def test_new_action_is_asked_for_points_and_missing_one_refused(bench):
    bench.base.asked = []
    bench.core.tasks.routing.surveyed({}, bench.now_s)
    answers = bench.ask(wire.Play(1, "wave"))
    settled(bench)
    assert answers == []
    kind = "play_motion_msgs/PlayMotionActionGoal"
    bench.core.tasks.routing.surveyed({"/play_motion/goal": kind}, bench.now_s)
    bench.base.asked.pop()()
    assert answers == [None]
    [(goal_id, _)] = bench.base.played
    ends(bench, goal_id, "succeeded")
    bench.core.tasks.routing.surveyed({}, bench.now_s)
    answers = bench.ask(wire.Play(1, "a motion that only the action would know"))
    bench.base.asked.pop()()
    assert [refusal.code for refusal in answers] == ["no_listener"]


def test_points_that_come_before_the_record_wait_for_it(bench):
    bench.sink.open.clear()
    answers = bench.ask(wire.Play(1, "wave"))
    bench.pass_time(0.1)
    assert (answers, bench.base.played) == ([], [])
    bench.sink.open.set()
    settled(bench)
    assert answers == [None]
    assert [motion for _, motion in bench.base.played] == ["wave"]


@pytest.mark.parametrize(
    ("happens", "outcome"),
    [
        (lambda bench: bench.order(wire.PlayCancel(1)), "cancelled"),
        (lambda bench: bench.core.revoke(1, "over", bench.now_s), "control_ended"),
        (lambda bench: bench.core.stop("Bob", "", bench.now_s), "stopped"),
        (lambda bench: setattr(bench.base, "listeners", 0), "robot_offline"),
        (lambda bench: bench.odometry(Velocity(0.3, 0.0, 0.0)), "base_moving"),
        (lambda bench: bench.pass_time(3.1), "robot_silent"),
        (lambda bench: bench.core.pause(1, "the page was left", 1, bench.now_s), "link_lost"),
        (lambda bench: bench.core.link_lost(1, bench.now_s), "link_lost"),
        (lambda bench: bench.granted(link=2), "other_link"),
        (lambda bench: runs_out(bench), "no_lease"),
        (lambda bench: bench.core.tasks.routing.surveyed({}, bench.now_s), "no_listener"),
        (lambda bench: bench.core.close(bench.now_s), "bridge_ended"),
    ],
)
def test_event_before_the_points_prevents_the_motion(bench, happens, outcome):
    bench.base.asked = []
    answers = bench.ask(wire.Play(1, "wave"))
    bench.recorded()
    happens(bench)
    bench.base.asked.pop()()
    settled(bench)
    bench.recorded()
    assert bench.base.played == []
    assert len(answers) == 1
    assert bench.sink.kinds == ["motion.start", "motion.end"]
    assert bench.sink.records[-1][1].outcome == outcome


def test_the_base_stands_while_the_robot_is_asked_for_points(bench):
    bench.base.asked = []
    bench.ask(wire.Play(1, "wave"))
    refusal = bench.stick(0.5)
    assert refusal.code == "motion_running"
    assert refusal.text == "The robot is about to perform “wave”, requested by Ann."
    assert bench.last == STILL


def test_one_motion_at_a_time_is_asked_for_its_points(bench):
    bench.base.asked = []
    assert bench.ask(wire.Play(1, "wave")) == []
    assert ask(bench, "nod").code == "motion_running"
    bench.pass_time(3.1)
    answers = bench.ask(wire.Play(1, "nod"))
    late, points = bench.base.asked
    del bench.base.sweeps["wave"]
    late()
    settled(bench)
    assert answers == []
    points()
    settled(bench)
    assert answers == [None]
    assert [motion for _, motion in bench.base.played] == ["nod"]


@pytest.mark.parametrize(
    ("happens", "outcome"),
    [
        (lambda bench: setattr(bench.gate, "seen", [(0.6, 0.0)]), "motion_blocked"),
        (lambda bench: setattr(bench.base, "listeners", 0), "robot_offline"),
        (lambda bench: bench.odometry(Velocity(0.3, 0.0, 0.0)), "base_moving"),
        (lambda bench: bench.order(wire.PlayCancel(1)), "cancelled"),
    ],
)
def test_event_before_the_record_prevents_the_motion(bench, happens, outcome):
    bench.sink.open.clear()
    ask(bench)
    happens(bench)
    bench.core.tick(bench.now_s)
    bench.sink.open.set()
    settled(bench)
    bench.recorded()
    assert bench.base.played == []
    assert bench.sink.kinds == ["motion.start", "motion.end"]
    assert bench.sink.records[-1][1].outcome == outcome


def test_the_end_of_another_goal_ends_nothing_here(bench):
    goal_id = begun(bench)
    bench.core.tasks.motions.ended("another", "done", "", bench.now_s)
    assert bench.core.state(bench.now_s, []).motion.name == "wave"
    assert ends(bench, goal_id, "done").outcome == "done"


@pytest.mark.parametrize(
    ("happens", "outcome"),
    [
        (lambda bench: bench.order(wire.PlayCancel(1)), "cancelled"),
        (lambda bench: bench.core.stop("Bob", "", bench.now_s), "stopped"),
        (lambda bench: bench.core.revoke(1, "over", bench.now_s), "control_ended"),
    ],
)
def test_cancel_stop_and_the_end_of_control_cancel_it_at_once(bench, happens, outcome):
    goal_id = begun(bench)
    happens(bench)
    assert bench.base.cancelled_goals == [goal_id]
    assert ends(bench, goal_id).outcome == outcome


def test_cancel_is_repeated_until_the_robot_obeys(bench):
    goal_id = begun(bench)
    bench.order(wire.PlayCancel(1))
    passes(bench, goal_id, 1.4)
    assert bench.base.cancelled_goals == [goal_id] * 3
    ends(bench, goal_id)
    passes(bench, goal_id, 1.0)
    assert bench.base.cancelled_goals == [goal_id] * 3


def test_link_lost_for_two_seconds_cancels_the_motion(bench):
    goal_id = begun(bench)
    bench.core.link_lost(1, bench.now_s)
    passes(bench, goal_id, 1.8)
    bench.granted(1)
    passes(bench, goal_id, 3.0)
    assert bench.base.cancelled_goals == []
    bench.core.link_lost(1, bench.now_s)
    passes(bench, goal_id, 2.2)
    assert bench.base.cancelled_goals == [goal_id]
    end = ends(bench, goal_id)
    assert (end.outcome, end.text) == (
        "link_lost",
        "The requester’s page was not connected for 2 s.",
    )


def test_a_goal_never_reported_by_the_robot_is_given_up(bench):
    begun(bench)
    bench.pass_time(2.2)
    bench.recorded()
    assert bench.sink.records[-1][1].outcome == "unheard"
    assert bench.core.state(bench.now_s, []).motion is None
    assert bench.stick(0.0) is None
    bench.driving()


def test_given_up_goal_is_cancelled_when_reported_again(bench):
    goal_id = begun(bench)
    bench.pass_time(2.2)
    bench.base.cancelled_goals.clear()
    passes(bench, goal_id, 0.2)
    assert bench.base.cancelled_goals == [goal_id]
    assert ask(bench, "nod").code == "motion_running"
    assert bench.stick(0.5).code == "motion_running"


def test_unwatched_goal_of_an_earlier_bridge_is_cancelled(bench):
    left = "fleet_bridge-left"
    passes(bench, left, 1.4)
    assert bench.base.cancelled_goals == [left] * 3
    refusal = ask(bench)
    assert refusal.code == "motion_running"
    assert (
        refusal.text
        == "The robot performs a motion that this console no longer watches: it is being cancelled."
    )
    bench.pass_time(2.2)
    bench.core.tasks.motions.running("/second_play", ["other"], bench.now_s)
    assert ask(bench).text == "The robot performs a motion that another program requested."
    bench.core.tasks.motions.running("/second_play", [], bench.now_s)
    begun(bench)


def cancels(bench):
    """This bridge's recorded cancels and their outcomes."""
    bench.recorded()
    cancels = [what for kind, what in bench.sink.records if kind == "motion.cancel"]
    return [what.outcome if isinstance(what, Outcome) else (what["topic"], what["goal"]) for what in cancels]


@pytest.mark.parametrize(("heard", "outcome"), [("cancelled", "cancelled"), (None, "unheard")])
def test_cancel_of_an_unwatched_goal_is_recorded_once(bench, heard, outcome):
    passes(bench, "fleet_bridge-left", 3.0)
    assert cancels(bench) == [("/play_motion", "fleet_bridge-left")]
    bench.core.tasks.motions.running("/play_motion", [], bench.now_s)
    if heard:
        bench.core.tasks.motions.ended("fleet_bridge-left", heard, "", bench.now_s)
    bench.pass_time(2.2)
    assert cancels(bench) == [("/play_motion", "fleet_bridge-left"), outcome]


def test_invented_goal_ids_give_few_records(bench):
    for number in range(20):
        bench.core.tasks.motions.running("/play_motion", [f"fleet_bridge-{number}"], bench.now_s)
        bench.pass_time(0.05)
    on_record = [("/play_motion", f"fleet_bridge-{number}") for number in range(3)]
    assert cancels(bench) == on_record
    bench.core.close(bench.now_s)
    assert cancels(bench) == [*on_record, *["bridge_ended"] * 3]


@pytest.mark.parametrize(
    "away", [lambda sink: setattr(sink, "fails", "disk full"), lambda sink: sink.open.clear()]
)
def test_unwatched_goals_are_limited_while_database_is_away(bench, away):
    away(bench.sink)
    for number in range(20):
        bench.core.tasks.motions.running("/play_motion", [f"fleet_bridge-{number}"], bench.now_s)
        bench.pass_time(2.2)
    assert len(bench.base.cancelled_goals) == 20
    bench.sink.fails = None
    bench.sink.open.set()
    bench.recorded()
    bench.pass_time(0.6)
    assert cancels(bench) == [
        *[("/play_motion", f"fleet_bridge-{number}") for number in range(3)],
        *["unheard"] * 3,
    ]


def test_cancel_of_unwatched_goals_does_not_wait_for_records(bench):
    bench.sink.open.clear()
    bench.core.tasks.motions.running("/play_motion", ["fleet_bridge-left"], bench.now_s)
    assert bench.base.cancelled_goals == ["fleet_bridge-left"]
    bench.sink.open.set()
    assert cancels(bench) == [("/play_motion", "fleet_bridge-left")]


def test_the_goals_id_names_the_record_of_its_request(bench):
    goal_id = begun(bench)
    bench.recorded()
    number = bench.sink.kinds.index("motion.start") + 1
    assert goal_id.startswith(f"fleet_bridge-{number}-")


def test_unwatched_goals_of_two_actions_are_cancelled_separately(bench):
    for _ in range(3):
        bench.core.tasks.motions.running("/play_motion", ["fleet_bridge-1"], bench.now_s)
        bench.core.tasks.motions.running("/second_play", ["fleet_bridge-2"], bench.now_s)
        bench.pass_time(0.6)
    assert bench.base.cancelled_goals == ["fleet_bridge-1", "fleet_bridge-2"] * 3


def test_goals_of_other_nodes_are_not_cancelled(bench):
    passes(bench, "/play_motion-7-1.2", 1.4)
    assert bench.base.cancelled_goals == []
    assert ask(bench).text == "The robot performs a motion that another program requested."


def test_bridge_end_cancels_and_records_the_motion(bench):
    goal_id = begun(bench)
    bench.core.close(bench.now_s)
    bench.recorded()
    assert bench.base.cancelled_goals == [goal_id]
    assert bench.sink.records[-1][1].text == "The bridge ended."


def test_only_the_holder_cancels_a_running_motion(bench):
    assert bench.order(wire.PlayCancel(1)).code == "no_motion"
    begun(bench)
    assert bench.order(wire.PlayCancel(2)).code == "unknown_fence"
    assert bench.base.cancelled_goals == []


def test_pages_see_the_motion_and_its_requester(bench):
    begun(bench)
    bench.pass_time(1.0)
    state = bench.core.state(bench.now_s, [])
    assert state.motion == wire.Motion("wave", "Ann", 1.0)


def test_parameters_that_make_no_motion_leave_its_points_unknown():
    point = {"positions": [0.1, 0.2], "time_from_start": 0.0}
    described = {
        "wave": {"joints": ["a", "b"], "points": [point], "meta": {"name": "Wave"}},
        "odd": {"joints": ["a"], "points": [point]},
        "far": {"joints": ["a"], "points": [{"positions": [1e9]}]},
        "nan": {"joints": ["a"], "points": [{"positions": [float("nan")]}]},
        "bare": {"joints": ["a"]},
    }
    motions = recorded(described)
    assert motions["wave"].points == ((0.1, 0.2),)
    assert [name for name, motion in motions.items() if motion is None] == ["bare", "far", "nan", "odd"]
    assert recorded(None) == {}


def test_cancel_by_a_person_without_control_names_them(bench):
    goal_id = begun(bench)
    assert bench.core.tasks.cancel("motion", "Sue Supervisor", bench.now_s) is None
    assert bench.base.cancelled_goals == [goal_id]
    assert ends(bench, goal_id).text == "Cancelled by Sue Supervisor."
    assert bench.core.tasks.cancel("motion", "Sue Supervisor", bench.now_s).code == "no_motion"
    bench.pass_time(NAMED_S + 1.0)  # all who see the robot see this, long after it was news
    assert bench.core.state(bench.now_s, []).motion_ended.text == "Another person cancelled it."


@pytest.mark.parametrize("takes_over", [False, True])
def test_a_stop_and_a_take_over_name_nobody_for_long(bench, takes_over):
    goal_id = begun(bench)
    if takes_over:
        bench.core.revoke(1, "Bob took over: lunch.", bench.now_s)
    else:
        bench.core.stop("Bob", "", bench.now_s)
    assert "Bob" in ends(bench, goal_id).text
    assert "Bob" in bench.core.state(bench.now_s, []).motion_ended.text
    bench.pass_time(NAMED_S + 1.0)
    assert "Bob" not in bench.core.state(bench.now_s, []).motion_ended.text


def test_motions_are_listed_with_title_and_duration():
    points = [{"positions": [0.1], "time_from_start": 0.5}, {"positions": [0.2], "time_from_start": 3.25}]
    meta = {"name": "Wave", "usage": "demo", "description": "Wave the hand"}
    described = {
        "wave": {"joints": ["a"], "points": points, "meta": meta},
        "odd": {"joints": ["a"], "points": [], "meta": {"name": 5}},
        "old": {"joints": ["a"], "points": points},
    }
    wave = wire.MotionOffer("wave", "Wave", "demo", "Wave the hand", 3.2)
    assert offered(described) == [
        wire.MotionOffer("odd", "odd"),
        wire.MotionOffer("old", "old", duration_s=3.2),
        wave,
    ]
    listed = {"wave": 0.0, "new": 2.0}
    assert offered(described, listed) == [wire.MotionOffer("new", "new", duration_s=2.0), wave]
    assert list(recorded(described, listed)) == ["new", "wave"]
    assert recorded(described, listed)["new"] is None
    assert offered(None) == []


def test_late_report_of_an_ended_motion_is_ignored(bench):
    goal_id = begun(bench)
    ends(bench, goal_id, "succeeded")
    bench.core.tasks.motions.running("/play_motion", [goal_id], bench.now_s)
    assert ask(bench, "nod") is None
