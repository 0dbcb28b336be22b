"""The core's chain: lease, dead-man, stop, neutral stick, audit."""

import itertools
from datetime import UTC, datetime
from uuid import uuid4

import msgspec
import pytest

from robots.bridge.gate.sensor_limits import Fault
from robots.bridge.gate.values import LaserScan
from robots.bridge.lease.state_store import SavedState
from robots.bridge.robot_reports import ODOMETRY_ONLINE_S, RosStatus
from robots.shared.geometry.poses import STILL, Pose, Velocity
from robots.shared.records.verdict import SpeedLimit, Verdict
from robots.shared.sentences import say
from robots.shared.wire import Grant, Revoke, encode, link_request
from tests.bridge.support import ORDERS, Bench, ObedientBench

FORWARD = Velocity(0.5, 0.0, 0.0)


def grant_of(fence):
    return Grant(fence, 60.0, f"session-{fence}", "Ann", "ann-id", 1.0)


@pytest.fixture
def bench():
    bench = Bench().online()
    yield bench
    bench.close()


def test_nothing_moves_without_control(bench):
    refusal = bench.stick(1.0)
    assert refusal.code == "no_lease"
    assert bench.base.sent == []


def test_command_is_published_on_arrival_and_on_each_tick(bench):
    bench.granted().driving()
    count = len(bench.base.sent)
    bench.stick(0.5)
    assert len(bench.base.sent) == count + 1
    bench.core.tick(bench.now_s)
    assert len(bench.base.sent) == count + 2
    assert bench.last == FORWARD


def test_a_command_dies_after_three_tenths_of_a_second(bench):
    bench.granted().driving()
    bench.pass_time(0.29)
    assert bench.last == FORWARD
    bench.pass_time(0.05)
    assert bench.last == STILL


def test_after_silence_the_stick_must_return_to_the_middle(bench):
    bench.granted().driving()
    bench.pass_time(0.5)
    refusal = bench.stick(0.5)
    assert refusal.code == "neutral_needed"
    assert "no command came for 0.3 s" in refusal.text
    assert refusal.figures == {"because": "dead_man", "why": "no command came for 0.3 s"}
    assert bench.stick(0.0) is None
    bench.driving()


def test_control_ends_whatever_the_consoles_reason_says(bench):
    """Its moments and the sentences in it come as texts and lists."""
    at = datetime(2026, 3, 2, 15, tzinfo=UTC)
    reason = say("Nobody drives from {time:clock} ({why}).", time=at, why=say("until {time:clock}", time=at))
    sent = link_request(encode(Revoke(1, reason))).sentence_of("reason")
    bench.granted().driving()
    bench.core.pause(1, sent, 1, bench.now_s)
    assert bench.last == STILL
    needed = bench.core.state(bench.now_s, []).neutral_needed
    assert needed.text == "Nobody drives from 15:00 (until 15:00)"
    assert needed.said == {"text": ["{reason:bare}", {"reason": reason.parts}]}
    bench.core.revoke(1, sent, bench.now_s)
    assert bench.core.lease.current is None


def test_the_reason_for_neutral_continues_its_sentence(bench):
    bench.granted().driving()
    bench.gate.says = lambda asked: Verdict(
        STILL, asked, "behind_unseen", "stopped: no look. Turn", neutral=True
    )
    bench.stick(-0.5)
    bench.gate.says = None
    assert bench.stick(-0.5).text == "Let the stick return to the middle: no look. Turn."
    assert bench.core.state(bench.now_s, []).neutral_needed.text == "no look. Turn"


def scan_goes_stale(bench):
    bench.gate.says = lambda asked: Verdict(STILL, asked, "scan_stale", "stopped: laser", neutral=True)
    bench.stick(0.5)


@pytest.mark.parametrize(
    ("happens", "code"),
    [
        (lambda bench: bench.core.stop("Bob", "", bench.now_s), "stopped"),
        (lambda bench: bench.core.pause(1, "The page is gone.", 1, bench.now_s), "page_gone"),
        (lambda bench: bench.core.link_lost(1, bench.now_s), "link_lost"),
        (lambda bench: bench.core.ros_status(RosStatus("waiting", ""), bench.now_s), "robot_offline"),
        (lambda bench: bench.core.grant(grant_of(2), 1, bench.now_s), "control_taken"),
        (lambda bench: bench.core.grant(grant_of(1), 2, bench.now_s), "page_back"),
        (lambda bench: bench.pass_time(0.5), "dead_man"),
        (scan_goes_stale, "scan_stale"),
    ],
)
def test_reason_for_neutral_has_a_code(bench, happens, code):
    bench.granted().driving()
    happens(bench)
    needed = bench.core.state(bench.now_s, []).neutral_needed
    assert needed.code == code and needed.text


def test_silence_with_the_stick_in_the_middle_asks_for_nothing(bench):
    bench.granted()
    bench.pass_time(1.0)
    bench.driving()


def test_old_fence_is_refused_naming_the_present_holder(bench):
    bench.granted(1).granted(2)
    refusal = bench.stick(1.0, fence=1)
    assert refusal.code == "old_fence"
    assert refusal.figures["holder"] == "Ann"
    assert bench.last == STILL


def test_a_number_that_was_never_given_is_refused(bench):
    bench.granted(1)
    assert bench.stick(1.0, fence=7).code == "unknown_fence"


def test_a_command_by_another_link_than_the_grants_is_refused(bench):
    bench.granted(1, link=1)
    assert bench.stick(1.0, link=2).code == "other_link"


def test_a_grant_below_the_highest_number_ever_seen_is_refused():
    bench = Bench(left=SavedState(False, "", "", 9))
    refusal = bench.core.lease.refuse_grant(Grant(8, 3, "s", "Bob", "b", 1.0))
    assert refusal.code == "old_fence"
    assert refusal.figures["highest"] == 9


def test_one_number_does_not_serve_two_control_sessions(bench):
    bench.granted(3)
    assert bench.core.lease.refuse_grant(Grant(3, 3, "another", "Bob", "b", 1.0)).code == "fence_taken"


def test_fence_belongs_to_its_session_after_control_ended(bench):
    bench.granted(3)
    bench.core.revoke(3, "released", bench.now_s)
    assert bench.core.lease.refuse_grant(Grant(3, 3, "another", "Bob", "b", 1.0)).code == "fence_taken"
    assert bench.core.lease.refuse_grant(Grant(3, 3, "session-3", "Ann", "ann-id", 1.0)) is None


def test_control_ends_by_the_bridges_own_clock(bench):
    bench.granted(seconds=2.0).driving()
    for _ in range(30):
        bench.pass_time(0.1)
        bench.stick(0.5)
    assert bench.last == STILL
    assert [ended.fence for ended in bench.notices] == [1]
    assert bench.stick(0.5).code == "no_lease"


def test_a_revoked_grant_stops_the_robot_at_once(bench):
    bench.granted().driving()
    bench.core.revoke(1, "Control was taken over.", bench.now_s)
    assert bench.last == STILL


def test_a_new_holder_starts_with_the_stick_in_the_middle(bench):
    bench.core.grant(Grant(1, 60, "s", "Ann", "a", 1.0), 1, bench.now_s)
    assert bench.stick(0.5).code == "neutral_needed"


def test_a_lost_link_stops_the_robot_at_once(bench):
    bench.granted().driving()
    bench.core.link_lost(1, bench.now_s)
    assert bench.last == STILL


def test_loss_of_another_web_process_does_not_stop_the_drive(bench):
    bench.granted(link=1).driving()
    bench.core.link_lost(2, bench.now_s)
    assert bench.last == FORWARD


def test_a_page_that_came_back_may_count_from_one_again(bench):
    bench.granted().driving()
    bench.core.pause(1, "the page was closed", 1, bench.now_s)
    assert bench.last == STILL
    bench.seq = 0
    bench.pass_time(1.0)
    bench.granted()  # same fence, but a new page with a new clock
    bench.driving()


def test_page_back_on_another_link_starts_from_neutral(bench):
    bench.granted(link=1).driving()
    grant = bench.core.lease.current
    bench.core.grant(grant, 2, bench.now_s)
    assert bench.last == STILL
    bench.seq = 0
    assert bench.stick(0.5, link=2).code == "neutral_needed"


def test_late_pause_from_the_old_link_is_ignored(bench):
    bench.granted(link=1).granted(link=2)
    bench.stick(0.5, link=2)
    bench.recorded()
    assert bench.stick(0.5, link=2) is None
    bench.core.pause(1, "The page is gone.", 1, bench.now_s)
    assert bench.last == FORWARD
    bench.core.pause(1, "The page is gone.", 2, bench.now_s)
    assert bench.last == STILL


def test_zeros_are_repeated_for_a_second_after_control(bench):
    bench.granted().driving()
    bench.core.revoke(1, "released", bench.now_s)
    bench.pass_time(0.9)
    count = len(bench.base.sent)
    bench.pass_time(3.0)
    assert len(bench.base.sent) <= count + 3
    assert set(bench.base.sent[-10:]) == {STILL}


def test_stop_sends_zero_cancels_every_goal_and_holds(bench):
    bench.granted().driving()
    bench.core.stop("Bob", "", bench.now_s)
    assert bench.last == STILL
    assert bench.base.cancelled >= 1
    assert bench.stick(0.5).code == "stopped"
    assert bench.stick(0.0) is None
    assert bench.stick(0.5).code == "stopped"
    assert bench.last == STILL


def cancels(bench, seconds: float) -> int:
    """Count cancels of all goals while time passes."""
    before = bench.base.cancelled
    bench.pass_time(seconds)
    return bench.base.cancelled - before


def test_stop_without_master_cancels_when_the_master_is_back():
    bench = Bench()
    bench.core.stop("Bob", "", bench.now_s)
    bench.pass_time(60.0)
    assert cancels(bench.online(), 1.0) >= 2  # the first cancel may have no subscriber yet


def test_stop_of_an_earlier_bridge_cancels_after_joining():
    assert cancels(Bench(left=SavedState(True, "Bob", "", 4)).online(), 1.0) >= 2


def test_cancel_is_repeated_exactly_while_stop_is_latched(bench):
    bench.pass_time(5.0)
    bench.core.stop("Bob", "", bench.now_s)
    assert cancels(bench, 10.0) == pytest.approx(20, abs=2)  # other nodes may send goals later
    before = bench.base.cancelled
    assert bench.core.clear(bench.core.stop_state.number, bench.now_s) is None
    assert bench.base.cancelled == before + 1  # for goals sent just before
    assert cancels(bench, 10.0) == 0


def test_stop_cleared_before_joining_still_cancels_once_joined():
    bench = Bench()
    bench.core.stop("Bob", "", bench.now_s)
    bench.core.clear(bench.core.stop_state.number, bench.now_s)
    bench.pass_time(60.0)
    assert cancels(bench.online(), 2.0) >= 2
    assert cancels(bench, 10.0) == 0


def test_stop_cleared_while_master_is_away_cancels_later(bench):
    bench.pass_time(5.0)
    bench.core.stop("Bob", "", bench.now_s)  # the robot's network has failed
    bench.core.ros_status(RosStatus("waiting", "No ROS master answers."), bench.now_s)
    bench.core.clear(bench.core.stop_state.number, bench.now_s)
    bench.pass_time(60.0)
    assert cancels(bench.online(), 2.0) >= 2


def test_a_stop_cancels_although_its_zero_fails(monkeypatch):
    """The press counts as handled: if it arrives by the other path, too, nothing is cancelled again."""
    bench = ObedientBench()
    bench.ask(ORDERS["motion"])
    bench.obeys()
    with monkeypatch.context() as patch, pytest.raises(RuntimeError, match="closed topic"):
        patch.setattr(bench.base, "publish", lambda _velocity: fails())
        bench.core.stop("Bob", "", bench.now_s, uuid4())
    assert len(bench.base.cancelled_goals) == 1
    assert bench.base.cancelled == 1
    assert cancels(bench, 2.0) >= 2


def test_a_stop_is_a_stop_although_its_cancel_fails():
    bench = ObedientBench()
    bench.base.cancel_all = fails
    bench.ask(ORDERS["motion"])
    bench.obeys()
    assert bench.base.played
    bench.core.stop("Bob", "", bench.now_s)
    assert len(bench.base.cancelled_goals) == 1
    bench.core.tick(bench.now_s + 0.5)
    assert bench.stick(0.5).code == "stopped"


def fails() -> None:
    raise RuntimeError("publish() to a closed topic")


def test_standstill_comes_from_odometry_not_from_commands(bench):
    bench.granted().driving()
    bench.odometry(FORWARD)
    bench.core.stop("Bob", "", bench.now_s)
    bench.pass_time(0.2)
    assert bench.core.stop_state.state == "stopping"
    bench.odometry(STILL)
    bench.pass_time(0.1)
    assert bench.core.stop_state.state == "stopped"
    assert bench.core.stop_state.standstill_ms == pytest.approx(250, abs=60)


def test_time_to_standstill_counts_from_the_watchdogs_press(bench):
    """The press arrives by link and by watchdog, at a bridge that was frozen for two seconds."""
    bench.granted().driving()
    bench.odometry(FORWARD)
    pressed_s, press = bench.now_s - 2.0, uuid4()
    for _ in range(2):
        bench.core.stop("Bob", "", bench.now_s, press)
    bench.pass_time(0.05)
    bench.core.stop_from_watchdog("Bob", "", press, bench.now_s, pressed_s)
    bench.odometry(STILL)
    bench.pass_time(0.05)
    took_ms = bench.core.stop_state.standstill_ms
    assert took_ms == pytest.approx(2100, abs=110)
    bench.core.stop_from_watchdog("Bob", "", press, bench.now_s, pressed_s - 1.0)  # again, earlier
    assert bench.core.stop_state.standstill_ms == took_ms + 1000


def test_a_stop_of_another_time_has_no_time_to_standstill(bench):
    bench.granted().driving()
    bench.odometry(FORWARD)
    bench.core.stop_from_watchdog("Bob", "", None, bench.now_s)
    bench.odometry(STILL)
    bench.pass_time(0.1)
    assert (bench.core.stop_state.state, bench.core.stop_state.standstill_ms) == ("stopped", None)


def test_a_stop_that_was_pending_has_no_time_to_standstill(bench):
    bench.granted().driving()
    bench.odometry(FORWARD)
    press = uuid4()
    bench.core.stop("Bob", "", bench.now_s, press, waited=True)
    bench.core.stop_from_watchdog("Bob", "", press, bench.now_s)  # the same press by the other path
    bench.odometry(STILL)
    bench.pass_time(0.1)
    assert (bench.core.stop_state.state, bench.core.stop_state.standstill_ms) == ("stopped", None)


def test_a_robot_that_stood_already_has_no_time_to_standstill(bench):
    bench.pass_time(0.1)
    bench.core.stop("Bob", "", bench.now_s)
    bench.pass_time(0.1)
    stop = bench.core.stop_state
    assert (stop.state, stop.was_standing, stop.standstill_ms) == ("stopped", True, None)


def test_robot_in_motion_was_not_standing_at_the_stop(bench):
    bench.granted().driving()
    bench.core.stop("Bob", "", bench.now_s)
    assert not bench.core.stop_state.was_standing
    pushed = Bench().online()
    pushed.pass_time(0.1)
    pushed.core.stop("Bob", "", pushed.now_s)
    pushed.odometry(FORWARD)
    pushed.core.tick(pushed.now_s)
    pushed.odometry(STILL)
    pushed.pass_time(0.1)
    stop = pushed.core.stop_state
    assert (stop.state, stop.was_standing) == ("stopped", False)
    assert stop.standstill_ms > 0


def test_without_odometry_standstill_is_not_claimed(bench):
    bench.core.stop("Bob", "", bench.now_s)
    bench.now_s += 0.5
    bench.core.tick(bench.now_s)
    assert bench.core.stop_state.state == "stopping"


def test_frozen_odometry_does_not_confirm_standstill(bench):
    bench.granted().driving()
    bench.speed = STILL  # the frozen message reports standstill
    bench.core.stop("Bob", "", bench.now_s)
    for _ in range(5):
        bench.now_s += 0.05
        bench.frozen_odometry()
        bench.core.tick(bench.now_s)
    assert bench.core.stop_state.state == "stopping"


def test_frozen_odometry_does_not_count_as_online_or_distance(bench):
    bench.granted().driving()
    for _ in range(25):
        bench.now_s += 0.05
        bench.x += 1.0
        bench.frozen_odometry()
        bench.core.tick(bench.now_s)
    assert bench.core.state(bench.now_s, []).phase == "connecting"
    bench.drives.end_drive("standstill", "test", bench.now_s)
    bench.recorded()
    assert bench.sink.records[-1][1].distance_m == 0.0


def test_clear_is_refused_if_stop_was_pressed_again(bench):
    bench.granted()
    bench.core.stop("Ann", "", bench.now_s)
    bench.pass_time(0.1)
    seen = bench.core.stop_state
    bench.core.stop("Bob", "a child on the floor", bench.now_s)
    refusal = bench.core.clear(seen.number, bench.now_s)
    assert (refusal.code, bench.core.stop_state.reason) == ("stopped_again", "a child on the floor")
    assert "by Bob" in refusal.text
    assert bench.core.clear(bench.core.stop_state.number, bench.now_s) is None
    assert bench.core.stop_state.state == "clear"


def test_name_of_the_presser_stays_until_the_clear(bench):
    bench.core.stop("Ann", "a child on the floor", bench.now_s)
    assert (bench.core.saved_state().by, bench.core.saved_state().reason) == ("Ann", "a child on the floor")
    assert bench.core.clear(bench.core.stop_state.number, bench.now_s) is None
    assert (bench.core.saved_state().by, bench.core.saved_state().reason) == ("", "")


def test_a_number_that_was_cleared_once_clears_no_later_stop(bench):
    bench.core.stop("Ann", "", bench.now_s)
    number = bench.core.stop_state.number
    bench.core.clear(number, bench.now_s)
    bench.core.stop("Bob", "", bench.now_s)
    assert bench.core.clear(number, bench.now_s).code == "stopped_again"


def test_after_clearing_nothing_moves_before_neutral(bench):
    bench.granted().driving()
    bench.core.stop("Bob", "", bench.now_s)
    bench.pass_time(0.1)
    bench.core.clear(bench.core.stop_state.number, bench.now_s)
    assert bench.last == STILL
    assert bench.stick(0.5).code == "neutral_needed"
    bench.stick(0.0)
    bench.driving()


def test_a_pressed_stop_is_found_again_after_a_kill():
    bench = Bench(left=SavedState(True, "Bob", "", 4))
    bench.core.tick(bench.now_s)
    assert bench.core.stop_state.state == "stopping"  # standstill is not observed yet
    bench.online().granted(5)
    assert bench.stick(1.0, fence=5).code == "stopped"
    assert bench.core.stop_state.by == "Bob"
    bench.pass_time(0.05)
    assert (bench.core.stop_state.state, bench.core.stop_state.standstill_ms) == ("stopped", None)


def test_lost_master_stops_the_robot_and_needs_neutral(bench):
    bench.granted().driving()
    bench.core.ros_status(RosStatus("waiting", "No ROS master answers."), bench.now_s)
    assert bench.last == STILL
    assert bench.stick(0.5).code == "robot_offline"
    bench.core.ros_status(RosStatus("connecting", ""), bench.now_s)
    assert bench.stick(0.5).code == "neutral_needed"


def test_a_robot_without_drive_subscriber_is_not_driven(bench):
    bench.granted()
    bench.base.listeners = 0
    refusal = bench.stick(0.5)
    assert refusal.code == "robot_offline"
    assert "/key_vel" in refusal.text


def test_the_gate_hears_of_each_new_driver_once(bench):
    for fence in (1, 1, 2):
        bench.granted(fence)
    assert bench.gate.drivers == 2


def test_a_stop_by_missing_sensor_data_asks_for_a_neutral_stick(bench):
    bench.granted().driving()
    bench.gate.says = lambda asked: Verdict(STILL, asked, "scan_stale", "the laser is silent", neutral=True)
    bench.stick(0.5)
    assert bench.last == STILL
    bench.gate.says = None
    assert bench.stick(0.5).code == "neutral_needed"


def silence_of_the_laser(bench):
    bench.gate.misses = Fault("scan_stale", "laser is 0.6 s old", "laser")


def silence_of_odometry(bench):
    bench.now_s += ODOMETRY_ONLINE_S + 0.1
    bench.core.tick(bench.now_s)


def all_is_back(bench):
    bench.gate.misses = None
    bench.pass_time(0.05)


@pytest.mark.parametrize("goes", [silence_of_the_laser, silence_of_odometry])
def test_a_stick_at_rest_counts_only_once_the_sensor_is_back(bench, goes):
    bench.granted().driving()
    goes(bench)
    bench.stick(0.5)
    bench.stick(0.0)
    bench.stick(0.5)
    all_is_back(bench)
    assert bench.stick(0.5).code == "neutral_needed"
    bench.pass_time(0.2)
    assert bench.last == STILL
    bench.stick(0.0)
    bench.driving()


@pytest.mark.parametrize("goes", [silence_of_the_laser, silence_of_odometry])
def test_stick_pushed_during_sensor_silence_needs_neutral_later(bench, goes):
    """The stick was neutral before, and its push still waits for its record when the sensor is back."""
    bench.granted()
    goes(bench)
    bench.sink.open.clear()
    bench.stick(0.5)
    bench.sink.open.set()
    bench.recorded()
    all_is_back(bench)
    assert bench.stick(0.5).code == "neutral_needed"
    assert bench.last == STILL


def test_odometry_that_is_not_a_number_is_counted_and_not_used(bench):
    bench.odometry(Velocity(float("nan"), 0.0, 0.0))
    assert bench.core.refused["odometry_not_finite"] == 1


# --- nothing happens without a record -------------------------------------------------------------


def test_zeros_are_sent_until_the_drives_start_is_committed(bench):
    bench.granted()
    bench.sink.open.clear()
    bench.stick(0.5)
    bench.pass_time(0.2)
    assert set(bench.base.sent) == {STILL}
    bench.sink.open.set()
    bench.recorded()
    bench.stick(0.5)
    assert bench.last == FORWARD


def test_a_drive_that_cannot_be_recorded_does_not_begin(bench):
    bench.granted()
    bench.sink.fails = "no space left on device"
    bench.stick(0.5)
    bench.recorded()
    bench.pass_time(0.1)
    refusal = bench.stick(0.5)
    assert refusal.code == "not_recorded"
    assert "no space left on device" in refusal.text
    assert set(bench.base.sent) == {STILL}


def test_driving_resumes_when_recording_does(bench):
    test_a_drive_that_cannot_be_recorded_does_not_begin(bench)
    bench.sink.fails = None
    bench.pass_time(1.0)
    bench.stick(0.0)
    bench.driving()


def test_a_record_that_hangs_for_two_seconds_stops_the_robot(bench):
    bench.granted().driving()
    bench.sink.open.clear()
    bench.gate.says = lambda asked: Verdict(Velocity(0.1, 0, 0), asked, "obstacle", "slowed")
    for _ in range(45):
        bench.stick(0.5)
        bench.pass_time(0.05)
    assert bench.last == STILL
    bench.sink.open.set()


def test_a_drive_is_one_start_and_one_end_with_its_distance(bench):
    bench.granted().driving()
    bench.odometry(FORWARD)
    bench.x = 1.25
    bench.stick(0.0)
    bench.odometry(STILL)
    bench.pass_time(1.0)
    bench.recorded()
    assert bench.sink.kinds == ["drive.start", "drive.end"]
    summary = bench.sink.records[-1][1]
    assert summary.distance_m == pytest.approx(1.25)
    assert summary.top_mps == 0.5
    assert summary.ended_by == "standstill"


def test_drive_stopped_by_missing_sensor_data_records_the_cause(bench):
    bench.granted().driving()
    bench.gate.says = lambda asked: Verdict(STILL, asked, "scan_stale", "the laser is silent", neutral=True)
    bench.stick(0.5)
    bench.pass_time(1.0)
    bench.recorded()
    assert bench.sink.records[-1][1].ended_by == "the laser is silent"


def test_a_drive_whose_end_odometry_does_not_show_says_so(bench):
    bench.granted().driving()
    bench.stick(0.0)
    for _ in range(20):
        bench.now_s += 0.05
        bench.core.tick(bench.now_s)
    bench.recorded()
    assert bench.sink.records[-1][1].ended_by == "no new odometry arrived"


def held(bench, *codes, for_s, neutral=False):
    """Hold the stick while the gate limits by these rules in turn, one rule for each decision."""
    turns = itertools.cycle(codes)

    def says(asked):
        code = next(turns)
        velocity = asked if code == "free" else Velocity(0.1, 0, 0)
        return Verdict(velocity, asked, code, f"{code}!", "laser", 0.4, 0.0, "ahead", neutral=neutral)

    bench.gate.says = says
    for _ in range(round(for_s / 0.05)):
        bench.stick(0.5)
        bench.pass_time(0.05)
    bench.recorded()


@pytest.mark.parametrize(
    "code",
    [
        "obstacle",
        "near_miss",
        "mover",
        "robot_late",
        "operator_late",
        "depth_missing",
        "depth_stale",
        "head_away",
        "blind_direction",
        "sonar_stale",
        "arm_away",
        "scan_late",
    ],
)
def test_intervention_has_one_begin_and_one_end_record(bench, code):
    bench.granted().driving()
    held(bench, code, for_s=1.0)
    held(bench, "free", for_s=1.5)
    assert bench.sink.kinds == ["drive.start", "gate.begin", "gate.end"]
    (_, start), (_, ended) = bench.sink.records[1:]
    begun = start.verdict
    assert (begun.code, begun.sensor, begun.side, begun.distance_m) == (code, "laser", "ahead", 0.4)
    assert (begun.asked, begun.velocity) == (Velocity(0.5, 0, 0), Velocity(0.1, 0, 0))
    assert ended.duration_s == pytest.approx(0.95, abs=0.1)


@pytest.mark.parametrize(
    "codes", [("obstacle", "free"), ("obstacle", "near_miss"), ("mover", "free", "scan_late")]
)
def test_flickering_rule_is_one_intervention_naming_others(bench, codes):
    bench.granted().driving()
    held(bench, *codes, for_s=5.0)
    held(bench, "free", for_s=1.5)
    assert bench.sink.kinds == ["drive.start", "gate.begin", "gate.end"]
    assert bench.sink.records[-1][1].also == sorted({*codes} - {codes[0], "free"})


def test_rule_that_replaces_another_is_a_new_intervention(bench):
    bench.granted().driving()
    held(bench, "near_miss", for_s=1.0)
    held(bench, "obstacle", for_s=2.0)
    assert bench.sink.kinds == ["drive.start", "gate.begin", "gate.end", "gate.begin"]
    assert bench.sink.records[-1][1].verdict.code == "obstacle"


def test_stop_that_needs_neutral_is_always_recorded_at_once(bench):
    bench.granted().driving()
    held(bench, "near_miss", for_s=0.5)
    held(bench, "scan_stale", for_s=0.05, neutral=True)
    assert bench.sink.kinds == ["drive.start", "gate.begin", "gate.end", "gate.begin"]
    assert bench.sink.records[-1][1].verdict.code == "scan_stale"


@pytest.mark.parametrize("code", ["free", "robot_limit"])
def test_limit_beyond_the_robots_ability_is_not_an_intervention(bench, code):
    bench.granted().driving()
    held(bench, code, for_s=1.5)
    assert bench.sink.kinds == ["drive.start"]


def test_a_robot_held_at_a_wall_is_still_one_drive(bench):
    bench.granted().driving()
    bench.gate.says = lambda asked: Verdict(STILL, asked, "obstacle", "stopped")
    for _ in range(40):
        bench.stick(0.5)
        bench.pass_time(0.05)
    bench.recorded()
    assert bench.sink.kinds == ["drive.start", "gate.begin"]


def test_gate_counts_page_delay_and_page_shows_robot_latency(bench):
    bench.core.grant(Grant(1, 60.0, "session-1", "Ann", "ann-id", 1.0, delay_s=0.7), 1, bench.now_s)
    assert bench.gate.operator_delay_s == 0.7
    state = bench.core.state(bench.now_s, [])
    assert (state.latency_s, state.latency_measured) == (0.2, False)


def test_speed_limits_are_reported_only_with_a_driver(bench):
    bench.granted().driving()
    limits = (
        SpeedLimit("arm_away", "at most 0.2 m/s", 0.2),
        SpeedLimit("sonar_stale", "at most 0.1 m/s", 0.1, "reverse"),
    )
    bench.gate.says = lambda asked: Verdict(STILL, asked, "sonar_stale", limits[1].text, way="reverse")
    bench.gate.limits = lambda now_s: limits
    bench.stick(-0.5)
    blocked = bench.core.state(bench.now_s, []).verdict
    assert (blocked.code, blocked.way) == ("sonar_stale", "reverse")
    assert msgspec.json.encode(blocked.limits) == (
        b'[{"code":"arm_away","text":"at most 0.2 m/s","mps":0.2},'
        b'{"code":"sonar_stale","text":"at most 0.1 m/s","mps":0.1,"way":"reverse"}]'
    )
    bench.core.revoke(1, "enough", bench.now_s)
    assert bench.core.state(bench.now_s, []).verdict.limits == []


def test_sensor_messages_prepare_the_gate_during_control(bench):
    bench.gate.observe_scan = lambda *_scan: None
    scan = LaserScan("laser", 50.0, 101.0, [1.0], 0.0, 0.1, 0.1, 9.0)
    for granted in (False, True):
        if granted:
            bench.granted()
        bench.core.odometry(50.0 + granted, 100.5, Pose(0.1 * granted, 0.0, 0.0), STILL, 50.0)
        bench.core.odometry(50.1 + granted, 100.6, Pose(0.1 * granted, 0.0, 0.0), STILL, 50.0)
        bench.core.laser(scan)
        bench.core.range("sonar", 50.0, 101.5, 1.0)
        assert bench.news == (3 if granted else 0), "while nobody has control nothing is prepared"


def test_gate_is_reset_once_for_a_new_run_of_the_robot(bench):
    for run, forgot in ((0, []), (1, [True]), (1, [True]), (3, [True, True])):
        bench.stamp_s += 0.02
        bench.core.odometry(bench.stamp_s, bench.now_s, Pose(0.0, 0.0, 0.0), STILL, 50.0, run)
        assert bench.gate.forgot == forgot


def test_pages_hear_at_once_that_a_robot_fell_silent(bench):
    bench.stamp_s += 0.02
    bench.core.odometry(bench.stamp_s, bench.now_s, Pose(0.0, 0.0, 0.0), STILL, 50.0, 0)
    before = bench.core.headline(bench.now_s + 0.3)
    assert bench.core.headline(bench.now_s) == before != bench.core.headline(bench.now_s + 0.45)


def test_state_says_why_memory_was_dropped_and_how_long_ago(bench):
    def said():
        bench.core.tick(bench.now_s)
        return bench.core.state(bench.now_s + 2.0, []).forgotten

    assert (said().number, said().code, said().ago_s) == (0, "bridge_started", 2.0)
    before = bench.core.headline(bench.now_s)
    bench.stamp_s += 0.02
    bench.core.odometry(bench.stamp_s, bench.now_s, Pose(0.0, 0.0, 0.0), STILL, 50.0, run=1)
    bench.now_s += 5.0
    assert (said().number, said().code, said().ago_s) == (1, "odometry_restarted", 2.0)
    assert said().text == "The robot forgot what it saw before: its odometry or its ROS was restarted."
    assert bench.core.headline(bench.now_s) != before, "pages are told at once"


@pytest.mark.parametrize(
    ("skew_s", "agree"), [(None, True), (0.05, True), (0.2, False), (-0.2, False), (3600.0, False)]
)
def test_velocities_have_no_stamp_if_the_robots_clock_differs(bench, skew_s, agree):
    """By ours, a controller whose clock is behind would go on for as long after the last velocity."""
    bench.core.reports.skew_s = skew_s
    assert bench.core.clocks_agree is agree
