"""The mux selects the same input as twist_mux."""

from __future__ import annotations

import pytest

from robots.simulator.physics.mux import INPUT_TIMEOUT_S, TIAGO_LOCKS, TwistMux


def test_a_lone_input_goes_through():
    assert TwistMux().passes("key_vel", 0.0)


def test_the_labs_joystick_wins_over_the_console():
    mux = TwistMux()
    mux.passes("joy_vel", 0.0)
    assert not mux.passes("key_vel", 0.1)
    assert mux.passes("joy_vel", 0.2)


def test_the_console_wins_over_navigation():
    mux = TwistMux()
    mux.passes("key_vel", 0.0)
    assert not mux.passes("nav_vel", 0.1)


def test_an_input_that_fell_silent_no_longer_counts():
    mux = TwistMux()
    mux.passes("joy_vel", 0.0)
    assert not mux.passes("key_vel", INPUT_TIMEOUT_S)
    assert mux.passes("key_vel", INPUT_TIMEOUT_S + 0.01)


def test_equal_priorities_both_go_through():
    mux = TwistMux()
    assert mux.passes("joy_vel", 0.0)
    assert mux.passes("tab_vel", 0.01)


@pytest.mark.parametrize("lock", TIAGO_LOCKS)
def test_every_lock_masks_the_console(lock):
    mux = TwistMux()
    mux.lock(lock, True)
    assert not mux.passes("key_vel", 0.0)
    assert not mux.passes("phone_vel", 0.0)
    mux.lock(lock, False)
    assert mux.passes("phone_vel", 0.0)


def test_the_joystick_ignores_locks_of_its_own_priority():
    mux = TwistMux()
    mux.lock("emergency_brake", True)
    assert mux.passes("joy_vel", 0.0)
    mux.lock("stop_closing_loop", True)
    assert not mux.passes("joy_vel", 0.1)


def test_a_masked_input_still_silences_lower_ones():
    """twist_mux compares priorities first and masks after."""
    mux = TwistMux()
    mux.lock("emergency_brake", True)
    mux.passes("key_vel", 0.0)
    mux.lock("emergency_brake", False)
    assert not mux.passes("nav_vel", 0.1)


def test_unknown_names_are_errors():
    with pytest.raises(KeyError):
        TwistMux().passes("no_such_vel", 0.0)
    with pytest.raises(KeyError):
        TwistMux().lock("no_such_lock", True)
