"""A robot that goes and comes back, and a second bridge for it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

import pytest

from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from tests.processes import end
from tests.ros.bridge_support import BridgeProcess, drivable, running_bridge
from tests.sides.side import Side

POSE = {"pose": "2,1.8,0", "seed": 1, "drift": 0}


def test_a_robot_that_comes_back_is_another_run(
    side: Side, simulator: Callable[..., Any], config: BridgeConfig, tmp_path: Path
) -> None:
    robot = simulator(**POSE)
    with running_bridge(config, side, tmp_path) as (_, hand):
        hand.state_until(drivable, "a robot that can be driven")
        hand.take_control(1)
        hand.drive_until(0.2, lambda state: state.odometry.vx > 0.05, "motion")
        end(robot)
        away = hand.state_until(lambda state: state.phase != "online" and state.text, "words about it")
        assert away.neutral_needed
        again = simulator(**POSE)
        state = hand.state_until(lambda state: state.forgotten.code == "odometry_restarted", "another run")
        assert state.neutral_needed
        hand.let_go()
        hand.state_until(drivable, "a robot that can be driven")
        hand.drive_until(0.2, lambda state: state.odometry.vx > 0.05, "motion again")
    end(again)


@pytest.mark.last  # a killed bridge stays in its domain for a while
def test_only_one_bridge_drives_a_robot(side: Side, start: Callable[..., Any], tmp_path: Path) -> None:
    """The other one is of another console: it has the same name, and a robot of its own."""
    first = start(BridgeProcess)
    with ExitStack() as ending:
        hand = ending.enter_context(closing(first.link()))
        hand.state_until(drivable, "a robot that can be driven")
        _, second = ending.enter_context(running_bridge(side.config(tmp_path), side, tmp_path))
        state = second.state_until(lambda state: state.phase == "refused", "the refusal")
        assert "drives this robot" in state.text
        second.take_control(1)
        second.stick(1.0)
        refused = second.until(lambda report: isinstance(report, wire.Refused), "a refused command")
        assert refused.refusal.code == "robot_offline"
        assert hand.state.phase == "online"
        second.let_go()
        first.kill()
        second.state_until(drivable, "the robot, for the second")
