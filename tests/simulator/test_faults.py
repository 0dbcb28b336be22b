"""Faults are requested by text commands."""

from __future__ import annotations

import pytest

from robots.simulator.faults import FaultError, Faults, parse_faults
from robots.simulator.physics.base import Twist
from tests.simulator.conftest import room


def test_none_means_none():
    assert parse_faults("none") == Faults() == parse_faults("")


def test_several_at_once():
    assert parse_faults("laser_dead, brake_share=0.6") == Faults(laser_dead=True, brake_share=0.6)


@pytest.mark.parametrize(
    "text", ["laser_deaf", "laser_dead=1", "brake_share", "brake_share=much", "slip_share=1"]
)
def test_nonsense_is_refused(text):
    with pytest.raises(FaultError):
        parse_faults(text)


def test_a_delay_holds_commands_back(robot_in):
    driven = robot_in(room())
    driven.robot.faults = parse_faults("command_delay_s=0.3")
    driven.drive(Twist(0.5), 0.28)
    assert driven.robot.physics.velocity.vx == 0.0
    driven.drive(Twist(0.5), 0.2)
    assert driven.robot.physics.velocity.vx > 0.0
