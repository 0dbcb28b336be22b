"""Age, life and velocity of stick commands."""

import pytest

from robots.bridge.drive.drive_input import AgeEstimator, DriveInput, velocity_of
from robots.shared.configuration.gate_profile import Limits
from robots.shared.geometry.poses import STILL
from robots.shared.wire import Drive

LIMITS = Limits(1.0, 0.2, 0.5, 2.0, 1.0, 2.0)


def drive(seq: int, sent_s: float, x: float = 0.5, **fields: float) -> Drive:
    return Drive(fence=1, seq=seq, sent_ms=sent_s * 1000, x=x, w=fields.pop("w", 0.0), **fields)


def test_age_is_the_delay_beyond_the_fastest_message():
    age = AgeEstimator()
    assert age.age_s(sent_s=5.0, now_s=100.05) == 0.0
    assert age.age_s(sent_s=5.1, now_s=100.25) == pytest.approx(0.10)
    assert age.age_s(sent_s=5.2, now_s=100.21) == pytest.approx(0.0)  # a faster message is the new reference
    assert age.age_s(sent_s=5.3, now_s=100.35) == pytest.approx(0.04)


def test_permanently_slower_network_is_accepted_after_a_minute():
    age = AgeEstimator()
    age.age_s(0.0, 100.0)
    ages = [age.age_s(second, 100.5 + second) for second in range(1, 65)]
    assert ages[0] == pytest.approx(0.5)
    assert ages[-1] == pytest.approx(0.0)


def test_a_burst_after_a_stall_is_dropped_and_not_replayed():
    stick = DriveInput()
    assert stick.accept(drive(1, 0.0), 10.0) is None
    held_up = [stick.accept(drive(2 + n, 0.02 * (n + 1)), 11.01) for n in range(40)]
    assert [refusal.code for refusal in held_up if refusal] == ["too_old"] * 35
    assert stick.current(11.01) is not None  # the newest commands still count


def test_command_life_counts_from_sending_not_from_arrival():
    stick = DriveInput()
    stick.accept(drive(1, 0.0), 10.0)
    stick.accept(drive(2, 0.1), 10.3)  # 0.2 s late
    assert stick.current(10.39) is not None
    assert stick.current(10.41) is None


def test_a_command_that_was_overtaken_is_dropped():
    stick = DriveInput()
    stick.accept(drive(5, 0.1), 10.0)
    refusal = stick.accept(drive(4, 0.1), 10.0)
    assert refusal is not None
    assert refusal.code == "out_of_order"
    assert refusal.figures == {"seq": 4, "newest_seq": 5}


def test_full_reverse_stick_is_the_reverse_limit_at_small_share():
    assert velocity_of(drive(1, 0.0, x=-1.0, share=0.4), LIMITS, 1.0, "turn").vx == -0.2
    assert velocity_of(drive(1, 0.0, x=1.0, share=0.4), LIMITS, 1.0, "turn").vx == 0.4


def test_commands_share_is_limited_by_the_grant():
    assert velocity_of(drive(1, 0.0, x=1.0, share=1.0), LIMITS, 0.3, "turn").vx == pytest.approx(0.3)


def test_car_steering_mirrors_the_turn_in_reverse_only():
    assert velocity_of(drive(1, 0.0, x=-1.0, w=0.5, share=1.0), LIMITS, 1.0, "car").w == -1.0
    assert velocity_of(drive(1, 0.0, x=-1.0, w=0.5, share=1.0), LIMITS, 1.0, "turn").w == 1.0
    assert velocity_of(drive(1, 0.0, x=1.0, w=0.5, share=1.0), LIMITS, 1.0, "car").w == 1.0


def test_a_stick_in_the_middle_asks_for_standstill():
    assert velocity_of(drive(1, 0.0, x=-0.0), LIMITS, 1.0, "car") == STILL
