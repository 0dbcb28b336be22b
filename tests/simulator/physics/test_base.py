"""The base controller keeps TIAGo's limits."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.simulator.physics.base import STILL, TIAGO, BaseController, Twist

DT = 0.02


def settle(controller: BaseController, twist: Twist, seconds: float = 3.0) -> Twist:
    """The velocity after `seconds` of the same command, which is repeated as the console does."""
    for tick in range(round(seconds / DT)):
        controller.command(twist, tick * DT)
        controller.step(tick * DT, DT)
    return controller.velocity


@pytest.mark.parametrize(
    ("asked", "reached"),
    [
        (Twist(5.0, 0.0, 0.0), Twist(1.0, 0.0, 0.0)),
        (Twist(-5.0, 0.0, 0.0), Twist(-0.2, 0.0, 0.0)),
        (Twist(0.0, 5.0, 0.0), STILL),
        (Twist(0.0, 0.0, 9.0), Twist(0.0, 0.0, 2.0944)),
        (Twist(0.0, 0.0, -9.0), Twist(0.0, 0.0, -2.0944)),
    ],
)
def test_velocities_end_at_the_limits(asked, reached):
    assert settle(BaseController(), asked) == pytest.approx(reached)


def test_it_accelerates_and_brakes_at_1_mps2():
    controller = BaseController()
    controller.command(Twist(1.0), 0.0)
    assert controller.step(0.0, DT).vx == pytest.approx(DT)
    controller.command(Twist(-1.0), DT)
    assert controller.step(DT, DT).vx == pytest.approx(0.0)


def test_it_stops_a_quarter_of_a_second_after_the_last_command():
    controller = BaseController()
    controller.command(Twist(0.1), 0.0)
    for tick in range(10):
        controller.step(tick * DT, DT)
    assert controller.step(TIAGO.timeout_s, DT).vx == pytest.approx(0.1)
    assert controller.step(TIAGO.timeout_s + 0.001, DT).vx < 0.1


def test_it_stands_before_anything_was_commanded():
    assert BaseController().step(1000.0, DT) == STILL


def test_worn_brakes_take_longer():
    controller = BaseController()
    controller.brake_share = 0.5
    settle(controller, Twist(1.0))
    controller.command(STILL, 10.0)
    assert controller.step(10.0, DT).vx == pytest.approx(1.0 - 0.5 * DT)


@given(st.lists(st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.floats(-9, 9)), max_size=60))
def test_no_sequence_of_commands_leaves_the_limits(commands):
    controller = BaseController()
    before = STILL
    for tick, twist in enumerate(commands):
        controller.command(Twist(*twist), tick * DT)
        now = controller.step(tick * DT, DT)
        assert -0.2 <= now.vx <= 1.0
        assert now.vy == 0.0
        assert abs(now.w) <= 2.0944
        assert abs(now.vx - before.vx) <= 1.0 * DT + 1e-9
        assert abs(now.w - before.w) <= 2.0944 * DT + 1e-9
        before = now
