"""A base without an upper body, with its shipped profile: it is driven, goes to a place, and is stopped."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from tests.ros.bridge_support import BridgeProcess, Hand, WatchdogProcess
from tests.sides.navigation.traveller import FAR, Traveller
from tests.sides.side import SIDES, Side, running_side
from tests.sides.visitor import Visitor

PROFILES = {"ros1": "pmb2", "ros2": "pmb2-ros2"}
WHEELS = {"wheel_left_joint", "wheel_right_joint"}


@pytest.fixture(scope="module", params=SIDES)
def side(
    request: pytest.FixtureRequest, forks: None, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Side]:
    with running_side(request.param, tmp_path_factory.mktemp("side")) as side:
        side.profile = PROFILES[request.param]  # type: ignore[misc]
        yield side


@pytest.fixture(scope="module")
def robot(simulator: Callable[..., Any]) -> Any:
    return simulator(base="pmb2", world="office", pose="2,1.8,0", seed=1)


@pytest.fixture
def config(side: Side, tmp_path: Path) -> BridgeConfig:
    return side.config(tmp_path, "joint_states", "map", "navigation", gate={"has_depth": False})


def test_its_wheels_turn_while_it_is_driven(hand: Hand, visitor: Visitor) -> None:
    with visitor.listen("/joint_states", "sensor_msgs/JointState") as joints:
        before = joints.next()
        assert set(before.name) == WHEELS
        hand.drive_until(0.5, lambda state: state.odometry.vx > 0.1, "motion")
        after = joints.until(lambda message: min(message.velocity) > 0.5)
    assert all(later > earlier for earlier, later in zip(before.position, after.position, strict=True))
    assert {sensor.kind for sensor in hand.news().sensors} == {"odometry", "scan", "sonar"}


def test_it_goes_to_a_place_until_a_stop(
    watchdog: WatchdogProcess, bridge: BridgeProcess, hand: Hand
) -> None:
    hand.let_go()
    traveller = Traveller(bridge, hand)
    traveller.go(*FAR)
    traveller.drives()
    hand.send(wire.LinkStop("ann", "enough"))
    hand.state_until(lambda state: state.going_ended and state.odometry.vx == 0.0, "the end of the drive")
