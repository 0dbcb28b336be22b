"""Drives to a place: rules that need no robot. tests/ros/navigation tests the other rules."""

import json
import math

import msgspec
import numpy as np
import pytest

from robots.bridge.gate import navigation_watch
from robots.bridge.navigation.hold import UNENDED, UNHEARD, WATCHED_S
from robots.bridge.navigation.localisation import Localisation, Spread
from robots.bridge.navigation.navigation_goals import DOUBT_S, LOOKS_S
from robots.bridge.navigation.path import PlannedPath
from robots.shared import wire
from robots.shared.configuration.bridge_config import HeadSource, NavigationSource, Topic
from robots.shared.geometry.poses import STILL, Pose, Velocity
from robots.shared.maps.goal_map import UNKNOWN_NOW
from robots.shared.records.verdict import SpeedLimit, Verdict
from robots.shared.wire import Go, GoCancel, LookAhead
from tests.bridge.support import CONFIG, Bench, FreeMap

SOURCE = NavigationSource("/move_base", "/nav_vel", "/amcl_pose", set_pose="/initialpose")
TOPICS = msgspec.structs.replace(
    CONFIG.topics,
    navigation=SOURCE,
    map=Topic("/map", "nav_msgs/OccupancyGrid"),
    head=HeadSource("/head_controller/command", "head_1_joint", "head_2_joint", look_tilt=-0.68),
)
GO = Go(1, 3.0, 1.0, 0.5, seq=7, place="desk")


@pytest.fixture
def bench(monkeypatch):
    bench = Bench(config=msgspec.structs.replace(CONFIG, topics=TOPICS)).online().granted()
    bench.says = Verdict(STILL, STILL, "free", "")
    monkeypatch.setattr(navigation_watch, "judge", lambda gate, commanded, now_s: bench.says)
    bench.lost = None
    monkeypatch.setattr(navigation_watch, "depth_lost", lambda gate, now_s: bench.lost)
    bench.core.tasks.navigation.mapped(FreeMap(), bench.now_s)
    bench.navigation = bench.core.tasks.navigation
    bench.navigation.localisation.posed(Pose(0.0, 0.0, 0.0), Spread(0.01, 0.0, 0.01, 0.01), bench.now_s)
    localised(bench)
    passed(bench, 0.5)
    yield bench
    bench.close()


def localised(bench):
    bench.base.transform = (bench.now_s, Pose(0.0, 0.0, 0.0))


def passed(bench, seconds):
    """Let time pass; localisation and the console work, and navigation reports its goal."""
    for _ in range(round(seconds / 0.05)):
        localised(bench)
        bench.core.grant(wire.Grant(1, 60.0, "session-1", "Ann", "ann-id", 1.0), 1, bench.now_s)
        if bench.base.goals:
            bench.navigation.running("/move_base", [bench.base.goals[-1][0]], bench.now_s)
            bench.navigation.answered(bench.base.goals[-1][0], bench.now_s)
        bench.pass_time(0.05)


def gone(bench):
    """Begin a drive; return the goal's id."""
    answers = bench.ask(GO)
    bench.recorded()
    passed(bench, 0.2)
    assert answers == [None]
    (goal_id, goal) = bench.base.goals[-1]
    assert goal == Pose(3.0, 1.0, 0.5)
    return goal_id


def ended(bench):
    return bench.core.state(bench.now_s, []).going_ended


def test_the_watchdogs_cancel_is_no_other_programs(bench):
    goal = gone(bench)
    bench.core.cancelled_by_watchdog(1.2, bench.now_s)
    bench.navigation.ended(goal, "cancelled", "", bench.now_s)
    assert ended(bench).outcome == "overloaded"
    assert ended(bench).text == "This computer is overloaded: the bridge was 1.2 s late."


def test_it_is_sent_only_when_it_is_recorded(bench):
    bench.sink.open.clear()
    answers = bench.ask(GO)
    bench.pass_time(0.2)
    assert not bench.base.goals and not answers
    bench.sink.open.set()
    bench.recorded()
    passed(bench, 0.1)
    assert len(bench.base.goals) == 1 and answers == [None]
    assert ("go.start", {"x_m": 3.0, "y_m": 1.0, "heading_rad": 0.5, "place": "desk"}) in bench.sink.records


def test_a_place_of_another_map_is_refused(bench):
    (refusal,) = bench.ask(msgspec.structs.replace(GO, map="another"))
    assert refusal.code == "map_changed"
    (refusal,) = bench.ask(wire.SetPose(1, 0.1, 0.0, 0.0, seq=9, map="another"))
    assert refusal.code == "map_changed" and not bench.base.goals
    bench.ask(msgspec.structs.replace(GO, map=FreeMap().digest, seq=10))
    bench.recorded()
    passed(bench, 0.2)
    assert len(bench.base.goals) == 1


@pytest.mark.parametrize("read", ["free", "another", ""])
def test_another_map_server_ends_a_drive_only_by_another_map(bench, read):
    gone(bench)
    bench.core.tasks.navigation.map_doubted(bench.now_s, restarted=False)
    passed(bench, 1.0)
    assert bench.navigation.driving_requester is not None
    assert bench.navigation.refuse_map("") == UNKNOWN_NOW
    if read:
        bench.core.tasks.navigation.mapped(FreeMap(read), bench.now_s)
    else:
        bench.core.tasks.navigation.unmapped("nobody publishes /map", bench.now_s)
    assert (bench.navigation.driving_requester is not None) == (read == "free")
    assert (bench.navigation.localisation.refuse(bench.now_s) is None) == (read != "another")


def test_another_map_server_ends_a_drive_if_no_map_is_read(bench):
    gone(bench)
    bench.core.tasks.navigation.map_doubted(bench.now_s, restarted=False)
    passed(bench, DOUBT_S - 1.0)
    bench.core.tasks.navigation.mapped(FreeMap(), bench.now_s)
    passed(bench, 2.0)
    for _ in range(2):  # the second change does not begin the time anew
        assert bench.navigation.driving_requester is not None
        bench.core.tasks.navigation.map_doubted(bench.now_s, restarted=False)
        passed(bench, 0.5 * DOUBT_S + 0.2)
    going = bench.core.state(bench.now_s, []).going
    assert bench.navigation.driving_requester is None and "no map could be read" in going.ending


def test_without_its_watchdog_the_robot_is_not_sent(bench):
    bench.core.watchdog_missing = True
    (refusal,) = bench.ask(GO)
    assert refusal.code == "watchdog_missing"


def test_a_record_that_fails_sends_nothing(bench):
    bench.sink.fails = "the disk is full"
    answers = bench.ask(GO)
    bench.recorded()
    bench.pass_time(0.2)
    assert [answer.code for answer in answers] == ["not_recorded"] and not bench.base.goals


def test_the_bridge_is_silent_in_a_drive_and_sends_zeros_after_it(bench):
    goal_id = gone(bench)
    before = len(bench.base.sent)
    passed(bench, 1.0)
    assert len(bench.base.sent) == before
    bench.navigation.ended(goal_id, "succeeded", "Goal reached.", bench.now_s)
    bench.pass_time(0.1)
    assert bench.last == STILL and len(bench.base.sent) > before
    assert ended(bench).outcome == "arrived"


def test_the_gate_takes_over(bench):
    goal_id = gone(bench)
    before = len(bench.base.sent)
    text = "stopped: laser, 0.3 m ahead"
    bench.says = Verdict(STILL, Velocity(0.5, 0.0, 0.0), "obstacle", text, "laser", 0.3)
    bench.odometry(Velocity(0.5, 0.0, 0.0))
    assert len(bench.base.sent) > before and bench.last == STILL  # at once, before the next tick
    assert bench.base.cancelled_goals == [goal_id]
    bench.navigation.ended(goal_id, "cancelled", "", bench.now_s)
    end = ended(bench)
    assert (end.outcome, end.because, end.text) == ("held_back", "obstacle", "Stopped: laser, 0.3 m ahead.")
    bench.recorded()
    assert "gate.begin" in bench.sink.kinds


def test_a_cancel_ends_though_navigation_reports_the_goal_for_ever(bench):
    goal_id = gone(bench)
    assert bench.order(GoCancel(1)) is None
    passed(bench, 4.0)
    assert ended(bench).outcome == "cancelled"
    assert bench.base.cancelled_goals.count(goal_id) > 2
    answers = bench.ask(GO)
    bench.recorded()
    passed(bench, 0.2)
    assert answers == [None] and bench.base.goals[-1][0] != goal_id


def test_the_base_is_held_while_navigation_reports_the_ended_goal(bench):
    gone(bench)
    assert bench.order(GoCancel(1)) is None
    passed(bench, 6.0)  # `passed` reports the ended goal
    assert bench.navigation.hold.holds
    bench.navigation.running("/move_base", [], bench.now_s)
    bench.pass_time(1.5)
    assert not bench.navigation.hold.holds


def test_the_hold_goes_on_as_long_as_the_ended_goal_is_reported(bench):
    gone(bench)
    assert bench.order(GoCancel(1)) is None
    passed(bench, 29.0)
    assert bench.navigation.hold.holds and not bench.navigation.hold.why
    passed(bench, 4.0)
    assert bench.core.state(bench.now_s, []).navigation_held == UNENDED
    bench.recorded()
    assert "go.hold" in bench.sink.kinds


def ended_and_quiet(bench):
    """End a drive and wait until navigation is quiet; return the goal's id."""
    goal_id = gone(bench)
    assert bench.order(GoCancel(1)) is None
    bench.navigation.ended(goal_id, "cancelled", "", bench.now_s)
    bench.navigation.running("/move_base", [], bench.now_s)
    bench.base.goals.clear()
    quiet(bench)
    bench.base.cancelled_goals.clear()
    return goal_id


def quiet(bench):
    bench.pass_time(1.5)
    assert not bench.navigation.hold.holds


def drives_on(bench, seconds, others=()):
    """Let navigation send velocities without a goal of this bridge."""
    navigation = bench.core.tasks.navigation
    for _ in range(round(seconds / 0.1)):
        navigation.running("/move_base", others, bench.now_s)
        navigation.drove(Velocity(0.3, 0.0, 0.0), bench.now_s)
        bench.pass_time(0.1)


def test_navigation_that_pauses_and_then_drives_on_is_held_again(bench):
    goal_id = ended_and_quiet(bench)
    passed(bench, 20.0)
    drives_on(bench, 0.1)
    assert bench.navigation.hold.holds and not bench.navigation.hold.why
    drives_on(bench, 2.5)
    assert bench.core.state(bench.now_s, []).navigation_held == UNHEARD
    assert set(bench.base.cancelled_goals) == {goal_id}
    bench.recorded()
    assert "go.hold" in bench.sink.kinds
    quiet(bench)


def test_what_drives_long_after_the_goal_or_for_others_is_not_held(bench):
    ended_and_quiet(bench)
    drives_on(bench, 3.0, others=["theirs"])
    assert not bench.navigation.hold.holds
    bench.navigation.running("/move_base", [], bench.now_s)
    quiet(bench)
    bench.now_s += WATCHED_S
    bench.odometry()
    bench.pass_time(0.5)
    drives_on(bench, 3.0)
    assert not bench.navigation.hold.holds
    assert bench.core.saved_state().goal == ""


def test_being_held_again_does_not_prolong_the_watch(bench):
    ended_and_quiet(bench)
    passed(bench, WATCHED_S - 10.0)
    drives_on(bench, 1.0)
    assert bench.navigation.hold.holds
    quiet(bench)
    passed(bench, 20.0)
    drives_on(bench, 1.0)
    assert not bench.navigation.hold.holds


def test_what_drives_on_without_a_pause_is_held_for_five_minutes(bench):
    ended_and_quiet(bench)
    drives_on(bench, WATCHED_S - 5.0)
    assert bench.navigation.hold.holds
    drives_on(bench, 10.0)
    assert not bench.navigation.hold.holds


def test_a_goal_that_is_reported_for_ever_may_be_replaced(bench):
    gone(bench)
    assert bench.order(GoCancel(1)) is None
    passed(bench, 35.0)
    assert bench.navigation.hold.why == UNENDED
    gone(bench)


def test_a_bridge_that_begins_again_brakes_no_drive_of_others(bench):
    ended_and_quiet(bench)
    config = msgspec.structs.replace(CONFIG, topics=TOPICS)
    again = Bench(left=bench.core.saved_state(), config=config).online()
    navigation = again.core.tasks.navigation
    navigation.drove(Velocity(0.3, 0.0, 0.0), again.now_s)  # before the first report of goals
    assert not navigation.hold.holds
    drives_on(again, 1.0, others=["theirs"])
    assert not navigation.hold.holds
    again.close()


def test_a_bridge_that_hears_no_report_of_goals_holds_what_drives(bench):
    ended_and_quiet(bench)
    config = msgspec.structs.replace(CONFIG, topics=TOPICS)
    again = Bench(left=bench.core.saved_state(), config=config).online()
    for _ in range(25):
        again.core.tasks.navigation.drove(Velocity(0.3, 0.0, 0.0), again.now_s)
        again.pass_time(0.1)
    assert again.core.tasks.navigation.hold.holds
    again.close()


def test_a_bridge_that_begins_again_holds_what_drives_on(bench):
    goal_id = ended_and_quiet(bench)
    left = bench.core.saved_state()
    assert left.goal == goal_id
    config = msgspec.structs.replace(CONFIG, topics=TOPICS)
    again = Bench(left=left, config=config).online()
    again.pass_time(1.0)
    sent = len(again.base.sent)
    drives_on(again, 2.5)
    assert len(again.base.sent) > sent and again.last == STILL
    assert set(again.base.cancelled_goals) == {goal_id}
    again.close()


def test_the_goal_is_saved_as_soon_as_it_is_sent(bench):
    assert bench.core.saved_state().goal == ""
    goal_id = gone(bench)
    assert bench.core.saved_state().goal == goal_id


def test_no_drive_without_the_depth_camera(bench):
    bench.lost = "its picture is 3 s old"
    passed(bench, 6.0)  # just after control began, the camera may still start
    assert bench.order(GO).code == "depth_stale"


def test_the_head_does_not_look_elsewhere_during_a_drive(bench):
    gone(bench)
    answers = bench.ask(LookAhead(1))
    bench.recorded()
    passed(bench, 0.1)
    assert [answer.code for answer in answers] == ["going"]


def test_the_head_is_sent_ahead_again_and_again_during_a_drive(bench):
    gone(bench)
    bench.base.aims.clear()
    passed(bench, 6.0)
    assert {(aim.pan, aim.tilt) for aim in bench.base.aims} == {(0.0, -0.68)}
    assert len(bench.base.aims) == 3
    assert bench.order(GoCancel(1)) is None
    passed(bench, 0.1)
    bench.base.aims.clear()
    passed(bench, 4.0)
    assert not bench.base.aims


def test_a_goal_waits_until_the_depth_camera_looks_ahead(bench):
    bench.gate.looks = False
    answers = bench.ask(GO)
    bench.recorded()
    passed(bench, 1.0)
    assert not answers and not bench.base.goals
    assert [(aim.pan, aim.tilt) for aim in bench.base.aims] == [(0.0, -0.68)]
    bench.gate.looks = True
    passed(bench, 0.1)
    assert answers == [None] and len(bench.base.goals) == 1


def test_a_goal_is_refused_if_the_depth_camera_never_looks_ahead(bench):
    bench.gate.looks = False
    answers = bench.ask(GO)
    bench.recorded()
    passed(bench, LOOKS_S + 0.5)
    assert [answer.code for answer in answers] == ["head_away"] and not bench.base.goals


def test_the_head_does_not_move_for_a_drive_that_is_not_on_record(bench):
    bench.gate.looks = False
    bench.sink.fails = "the database is away"
    answers = bench.ask(GO)
    bench.recorded()
    passed(bench, 1.0)
    assert [answer.code for answer in answers] == ["not_recorded"] and not bench.base.aims


def test_the_watch_ends_a_drive_where_nothing_looks(bench):
    gone(bench)
    bench.gate.looks = False
    text = "at most 0.3 m/s: the depth camera looks away from the way ahead"
    bench.gate.unwatched = lambda now_s: SpeedLimit("head_away", text, 0.3)
    for _ in range(12):
        passed(bench, 0.2)
        bench.odometry(Velocity(0.5, 0.0, 0.0))
    passed(bench, 4.0)
    assert (ended(bench).outcome, ended(bench).because) == ("held_back", "head_away")


def test_a_motion_of_others_ends_a_drive(bench):
    gone(bench)
    bench.core.tasks.motions.running("/play_motion", ["other"], bench.now_s)
    passed(bench, 4.0)
    end = ended(bench)
    assert (end.outcome, end.text) == (
        "motion_running",
        "The robot performs a motion that another program requested.",
    )


def test_a_goal_of_an_earlier_bridge_is_cancelled_and_held(bench):
    bench.core.revoke(1, "over", bench.now_s)
    bench.pass_time(2.0)
    sent = len(bench.base.sent)
    bench.navigation.running("/move_base", ["fleet_bridge-1-left"], bench.now_s)
    bench.navigation.drove(Velocity(0.3, 0.0, 0.0), bench.now_s)
    bench.pass_time(0.5)
    assert bench.base.cancelled_goals == ["fleet_bridge-1-left"]
    assert len(bench.base.sent) > sent and bench.last == STILL
    bench.pass_time(3.0)
    sent = len(bench.base.sent)
    bench.pass_time(2.0)
    assert len(bench.base.sent) == sent  # navigation is quiet: the topic is free again


def test_a_lost_link_drops_a_goal_that_waits_for_its_record(bench):
    bench.sink.open.clear()
    answers = bench.ask(GO)
    bench.core.link_lost(1, bench.now_s)
    bench.sink.open.set()
    bench.recorded()
    bench.pass_time(0.3)
    assert [answer.code for answer in answers] == ["link_lost"] and not bench.base.goals


@pytest.mark.parametrize("other", ["/nav_vel"])
def test_no_drive_topic_that_navigation_uses_itself(bench, other):
    refusal = bench.navigation.refuse(Pose(1.0, 1.0, 0.0), other, bench.now_s)
    assert refusal.code == "no_navigation"


@pytest.mark.parametrize("bad", [math.nan, math.inf, 1e9, -1e9])
def test_no_number_that_makes_no_sense_passes_the_wire(bad):
    raw = json.dumps({"t": "go", "fence": 1, "x": bad, "y": 0.0, "heading": 0.0})
    with pytest.raises(wire.WireError):
        wire.browser_message(raw)


def test_a_small_correction_is_no_jump_and_a_long_silence_forgives():
    place = Localisation()
    place.moved(Pose(1.0, 0.0, 0.0))
    assert not place.transformed(1.0, Pose(0.0, 0.0, 0.0), 10.0)
    assert not place.transformed(2.0, Pose(0.3, 0.0, 0.1), 10.2)
    assert not place.transformed(2.0, Pose(9.0, 0.0, 0.0), 10.4)  # the same stamp: ignored
    assert place.transformed(3.0, Pose(0.9, 0.0, 0.1), 10.4)
    assert place.jumped_m == pytest.approx(0.6)
    assert not place.transformed(4.0, Pose(5.0, 0.0, 0.0), 20.0)


def test_a_path_is_thinned_and_its_rest_measured():
    path = PlannedPath()
    x = np.linspace(0.0, 10.0, 5001)
    path.take(np.column_stack([x, np.zeros_like(x)]))
    assert len(path.centimetres) == 2 * wire.MOST_PATH
    assert path.left_m(Pose(4.0, 0.0, 0.0), Pose(10.0, 0.0, 0.0)) == pytest.approx(6.0, abs=0.1)
    before = path.centimetres
    path.take(np.array([[math.nan, 0.0]]))
    assert path.centimetres == before
