"""Odometry follows the wheels and drifts with them."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from robots.simulator.physics.base import Twist
from robots.simulator.sensors.odometry import Drift
from tests.simulator.conftest import room


def gap(driven) -> float:
    """Distance of odometry from the truth, m."""
    truth, measured = driven.robot.physics.pose, driven.robot.odometry
    return math.hypot(measured.x - truth.x, measured.y - truth.y)


def test_without_drift_it_is_the_truth(robot_in):
    driven = robot_in(room())
    driven.drive(Twist(0.3, 0.0, 0.5), 6.0)
    assert gap(driven) < 0.01
    assert driven.robot.odometry.velocity.vx == pytest.approx(0.3, abs=0.01)


def test_with_drift_it_is_not_but_near(robot_in):
    driven = robot_in(room(), seed=3, drift=Drift())
    driven.drive(Twist(0.3, 0.0, 0.5), 20.0)
    assert 0.001 < gap(driven) < 0.3


def test_the_same_seed_drifts_the_same(robot_in):
    first, second, other = (robot_in(room(), seed=seed, drift=Drift()) for seed in (5, 5, 6))
    for driven in (first, second, other):
        driven.drive(Twist(0.3, 0.0, 0.5), 5.0)
    assert (first.robot.odometry.x, first.robot.odometry.y) == (
        second.robot.odometry.x,
        second.robot.odometry.y,
    )
    assert first.robot.odometry.x != other.robot.odometry.x


def test_standing_it_does_not_creep(robot_in):
    driven = robot_in(room(), seed=3, drift=Drift())
    driven.wait(2.0)
    assert (driven.robot.odometry.x, driven.robot.odometry.y) == pytest.approx((0.0, 0.0), abs=1e-6)


def test_slipping_wheels_turn_more_than_the_robot_moves(robot_in):
    driven = robot_in(room())
    driven.robot.faults = replace(driven.robot.faults, slip_share=0.3)
    driven.drive(Twist(0.3), 4.0)
    assert driven.robot.physics.pose.x == pytest.approx(0.7 * driven.robot.odometry.x, abs=0.02)
