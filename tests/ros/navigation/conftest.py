"""The holder of control of a robot with move_base."""

from __future__ import annotations

import pytest
from nav_msgs.msg import Odometry

from tests.sides.navigation.traveller import travelling
from tests.sides.side import Ros1Side


@pytest.fixture(scope="module", autouse=True)
def robot(ros, simulator):
    return simulator(pose="2,1.8,0", seed=1)


@pytest.fixture(scope="module")
def side(rosmaster):
    return Ros1Side(rosmaster)


@pytest.fixture
def traveller(side, robot, tmp_path):
    with travelling(side.config(tmp_path, "navigation", "map"), side, tmp_path) as traveller:
        yield traveller


@pytest.fixture
def truth(ros):
    with ros.listen("/ground_truth/pose", Odometry) as poses:
        yield poses
