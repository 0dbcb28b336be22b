"""A bridge of a robot with navigation, and the holder of control."""

from __future__ import annotations

import pytest

from tests.sides.navigation.traveller import travelling

RUNS = {1: {0, 1}, 2: {1, 2, 3}}  # statuses of a goal that is not over, by ROS


@pytest.fixture
def config(side, tmp_path):
    return side.config(tmp_path, "navigation", "map")


@pytest.fixture
def traveller(side, robot, tmp_path, config):
    with travelling(config, side, tmp_path) as traveller:
        yield traveller


@pytest.fixture
def truth(visitor, robot):
    with visitor.listen("/ground_truth/pose", "nav_msgs/Odometry") as poses:
        yield poses


@pytest.fixture
def twists(visitor, robot):
    with visitor.listen("/key_vel", "geometry_msgs/Twist") as twists:
        visitor.connected(twists)
        yield twists


@pytest.fixture
def rests(side, visitor):
    """``rests()`` waits until navigation has no goal."""
    action, ros1 = side.topics.navigation.action, side.number == 1
    topic, package = (f"{action}/status", "actionlib") if ros1 else (f"{action}/_action/status", "action")

    def wait() -> None:
        with visitor.listen(topic, f"{package}_msgs/GoalStatusArray", kept=True) as statuses:
            statuses.until(lambda told: RUNS[side.number].isdisjoint(one.status for one in told.status_list))

    return wait
