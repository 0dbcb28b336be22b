"""The check whether the robot may stand at a place of its map."""

import math
import struct

import numpy as np
import pytest

from robots.shared.configuration.gate_profile import GateProfile
from robots.shared.geometry.footprint import footprint_of
from robots.shared.geometry.poses import Pose
from robots.shared.maps.goal_map import GoalMap
from robots.shared.maps.occupancy import cells_of, taken
from tests.bridge.support import LIMITS

DISC = footprint_of(GateProfile(LIMITS, 0.27, None, {}, {}, {}, False, 0.3))
LONG = footprint_of(
    GateProfile(LIMITS, None, ((0.6, 0.2), (-0.6, 0.2), (-0.6, -0.2), (0.6, -0.2)), {}, {}, {}, False, 0.3)
)


def message(cells, resolution_m=0.05, origin=(0.0, 0.0, 0.0)):
    """A serialized nav_msgs/OccupancyGrid; row 0 is the lower edge."""
    height, width = cells.shape
    x, y, yaw = origin
    header = struct.pack("<III", 0, 0, 0) + struct.pack("<I", 3) + b"map"
    info = struct.pack(
        "<IIfII7d",
        0,
        0,
        resolution_m,
        width,
        height,
        x,
        y,
        0.0,
        0.0,
        0.0,
        math.sin(yaw / 2),
        math.cos(yaw / 2),
    )
    return header + info + struct.pack("<I", cells.size) + cells.astype(np.int8).tobytes()


def room(**changes):
    """A floor of 4 m x 3 m, with a pillar at (2, 1); the rest of the map is unknown."""
    cells = np.zeros((60, 80), np.int8)
    cells[19:21, 39:41] = 100
    return GoalMap(taken(message(cells, **changes)))


def test_the_picture_gives_the_cells_back():
    cells = np.zeros((5, 7), np.int8)
    cells[0, 0], cells[4, 6], cells[2] = 100, 100, -1
    found = cells_of(taken(message(cells)))
    assert found[0, 0] == found[4, 6] == 2 and (found[2] == 0).all() and found[1, 1] == 1


@pytest.mark.parametrize(
    ("goal", "code"),
    [
        ((1.0, 1.5, 0.0), None),
        ((2.0, 1.0, 0.0), "goal_in_obstacle"),
        ((2.25, 1.0, 0.0), "goal_in_obstacle"),  # the hull would be in the pillar
        ((2.40, 1.0, 0.0), None),
        ((-0.1, 1.0, 0.0), "goal_outside"),
        ((3.9, 3.1, 0.0), "goal_outside"),
        ((1e4, -1e4, 0.0), "goal_outside"),
    ],
)
def test_a_place_is_free_solid_or_unknown(goal, code):
    refusal = room().refuse(Pose(*goal), DISC)
    assert (refusal and refusal.code) == code


def test_the_heading_counts_for_a_long_robot():
    assert room().refuse(Pose(2.0, 1.5, 0.0), LONG) is None
    assert room().refuse(Pose(2.0, 1.5, math.pi / 2), LONG).code == "goal_in_obstacle"


def test_a_map_may_lie_anywhere():
    turned = room(origin=(5.0, 5.0, math.pi / 2))  # its x axis points north
    assert turned.refuse(Pose(4.0, 7.0, 0.0), DISC).code == "goal_in_obstacle"
    assert turned.refuse(Pose(3.5, 6.0, 0.0), DISC) is None
    assert turned.refuse(Pose(6.0, 6.0, 0.0), DISC).code == "goal_outside"
