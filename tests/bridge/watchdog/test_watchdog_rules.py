"""When the watchdog publishes zeros and cancels goals: by presses, and by the bridge's heartbeats."""

from __future__ import annotations

import pytest

from robots.bridge.watchdog.rules import (
    LOST_S,
    QUIET_AFTER_S,
    REACHES_S,
    SILENT_S,
    Heartbeat,
    StopPress,
    StopRules,
)

DRIVING = Heartbeat(publishing=True, drive="/key_vel")
STOPPED = Heartbeat(publishing=True, latched=True, by="Ann", reason="smoke", drive="/key_vel")


@pytest.fixture
def rules() -> StopRules:
    """A bridge is connected and drives, at second 10."""
    rules = StopRules(first=100)
    rules.bridge_came(10.0)
    rules.beat(DRIVING, 10.0)
    return rules


def test_a_bridge_that_lives_and_is_not_stopped_is_left_alone(rules: StopRules) -> None:
    assert not rules.zeros(10.05) and not rules.cancel(10.05)


def test_press_sends_zeros_and_cancels_until_bridge_latched_it(rules: StopRules) -> None:
    press = rules.press("Ann", "smoke")
    assert rules.zeros(10.0) and rules.cancel(10.0)
    assert rules.beat(DRIVING, 10.05) == press, "the watchdog must send it again"
    assert rules.beat(Heartbeat(publishing=True, latched=True, heard=press.number), 10.1) is None
    assert rules.zeros(10.1) and not rules.cancel(10.1), "now the bridge cancels"


def test_the_latch_ends_when_the_bridge_clears_it(rules: StopRules) -> None:
    press = rules.press("Ann", "smoke")
    rules.beat(Heartbeat(publishing=True, latched=True, heard=press.number), 10.1)
    rules.beat(Heartbeat(publishing=True, heard=press.number), 10.2)
    assert not rules.zeros(10.2)


def test_a_bridge_that_has_not_heard_of_a_stop_does_not_clear_it(rules: StopRules) -> None:
    first = rules.press("Ann", "")
    rules.press("Ben", "")
    rules.beat(Heartbeat(publishing=True, heard=first.number), 10.1)
    assert rules.latched


def test_a_silent_bridge_that_drove_gives_zeros_for_a_moment(rules: StopRules) -> None:
    assert not rules.zeros(10.0 + 0.9 * SILENT_S)
    assert rules.zeros(10.0 + SILENT_S + 0.01)
    rules.reached(10.0 + SILENT_S + 0.01)
    assert rules.zeros(10.0 + SILENT_S + QUIET_AFTER_S)
    assert not rules.zeros(10.0 + SILENT_S + QUIET_AFTER_S + 0.02)


def test_zeros_that_do_not_reach_the_robot_go_on_for_a_while(rules: StopRules) -> None:
    """The robot is found late, or the watchdog is late itself: the last heartbeat is old by then."""
    rules.bridge_gone(10.1)
    assert rules.zeros(13.0)
    rules.reached(13.0)
    assert rules.zeros(13.9) and not rules.zeros(14.1)
    rules.bridge_came(20.0)
    rules.beat(DRIVING, 20.0)
    rules.bridge_gone(20.1)
    assert rules.zeros(22.0) and not rules.zeros(20.1 + REACHES_S + 0.01)


def test_a_bridge_that_ends_is_silent_at_once(rules: StopRules) -> None:
    rules.bridge_gone(10.01)
    assert rules.zeros(10.01)


def test_a_bridge_that_did_not_drive_may_fall_silent(rules: StopRules) -> None:
    rules.beat(Heartbeat(publishing=False), 10.1)
    assert not rules.zeros(10.1 + SILENT_S + 0.01)


def test_a_stop_that_a_frozen_bridge_had_latched_stays_latched(rules: StopRules) -> None:
    rules.beat(STOPPED, 10.1)
    assert rules.zeros(500.0) and rules.cancel(500.0)


def test_stop_of_a_dead_bridge_stays_for_the_next_bridge(rules: StopRules) -> None:
    rules.beat(STOPPED, 10.1)
    rules.bridge_gone(10.2)
    assert rules.zeros(500.0) and rules.cancel(500.0)
    rules.bridge_came(600.0)
    repeated = rules.beat(Heartbeat(), 600.0)
    assert repeated is not None and (repeated.by, repeated.reason) == ("Ann", "smoke")
    assert rules.beat(Heartbeat(latched=True, heard=repeated.number), 600.1) is None


def test_stop_without_a_bridge_is_sent_to_the_next_one() -> None:
    rules = StopRules(first=100)
    press = rules.press("Ann", "smoke")
    assert rules.zeros(1.0) and rules.cancel(1.0)
    rules.bridge_came(2.0)
    assert rules.beat(Heartbeat(), 2.0) == press


@pytest.mark.parametrize("beat", [Heartbeat(latched=True), Heartbeat(True, listened=False, latched=True)])
def test_watchdog_cancels_if_bridge_does_not_reach_the_robot(rules: StopRules, beat: Heartbeat) -> None:
    rules.beat(beat, 10.1)
    assert rules.cancel(10.1)


def test_stop_with_a_lower_number_is_not_taken_as_heard() -> None:
    """The clock was set back between two watchdogs."""
    rules = StopRules(first=50)
    press = rules.press("Ann", "smoke")
    rules.bridge_came(2.0)
    assert rules.beat(Heartbeat(heard=100), 2.0) == press
    assert rules.latched


def test_latch_of_the_state_file_holds_until_a_bridge_reports() -> None:
    rules = StopRules(first=100, before=Heartbeat(latched=True, by="Ann", reason="smoke"))
    assert rules.zeros(500.0) and rules.cancel(500.0)
    rules.bridge_came(600.0)
    assert rules.beat(Heartbeat(), 600.0) is None, "it was cleared meanwhile, and must not come back"
    assert not rules.latched


def test_watchdog_starts_with_the_saved_stop() -> None:
    rules = StopRules(first=100, kept=StopPress(250, "Ann"))
    assert rules.zeros(0.0)
    assert rules.press("Ben", "").number > 250


def test_the_watchdog_brakes_for_a_bridge_that_dies_in_a_drive(rules: StopRules) -> None:
    rules.beat(Heartbeat(publishing=True, drive="/key_vel", drives_itself=True), 10.1)
    assert not rules.zeros(10.2) and not rules.cancel(10.2)
    rules.bridge_gone(10.2)
    assert rules.zeros(60.0) and rules.cancel(60.0)
    rules.bridge_came(61.0)
    rules.beat(Heartbeat(drive="/key_vel"), 61.0)
    assert not rules.zeros(61.0) and not rules.cancel(61.0)


def test_navigation_goes_on_after_a_bridge_that_hung_for_a_moment(rules: StopRules) -> None:
    driven = Heartbeat(publishing=True, drive="/key_vel", drives_itself=True)
    rules.beat(driven, 10.1)
    assert rules.zeros(10.1 + SILENT_S) and not rules.cancel(10.1 + SILENT_S)
    rules.beat(driven, 10.6)
    assert not rules.zeros(10.6) and not rules.cancel(10.6)
    assert not rules.cancel(11.5) and rules.hung(11.5) is None
    assert rules.zeros(10.61 + LOST_S) and rules.cancel(10.61 + LOST_S)
    hung = rules.hung(10.61 + LOST_S)
    assert hung is not None and hung.silent_s == pytest.approx(LOST_S + 0.01)
