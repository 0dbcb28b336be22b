"""The arm's place follows its joints, and it collides with objects."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from robots.simulator.joints.arm import SEGMENTS, capsules, lengths
from robots.simulator.joints.frames import frames
from robots.simulator.joints.joint_table import HOME
from robots.simulator.joints.motions import load_motions
from robots.simulator.physics.base import Twist
from robots.simulator.sensors.body import TIAGO
from robots.simulator.worlds import Box
from tests.simulator.conftest import room

TABLE = frames(TIAGO)
STRETCHED = HOME | dict(
    zip(load_motions()["point"].joints, load_motions()["point"].points[-1].positions, strict=True)
)


def ends(joints) -> list[tuple[np.ndarray, np.ndarray]]:
    """Both ends of each capsule."""
    found = []
    for (middle, (w, x, y, z)), length in zip(capsules(TABLE, joints), lengths(TABLE), strict=True):
        along = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]) * length / 2
        found.append((middle - along, middle + along))
    return found


@pytest.mark.parametrize("joints", [HOME, STRETCHED], ids=["home", "stretched"])
def test_the_segments_hang_together(joints):
    chain = ends(joints)
    for (_, end), (begin, _) in pairwise(chain):
        assert begin == pytest.approx(end, abs=1e-6)


def test_folded_it_stays_within_the_bases_circle():
    for segment, pair in zip(SEGMENTS, ends(HOME), strict=True):
        assert max(math.hypot(*end[:2]) for end in pair) + segment.radius <= 0.275


def test_stretched_it_reaches_a_metre():
    assert math.hypot(*ends(STRETCHED)[-1][1][:2]) > 0.9


def test_a_robot_at_home_touches_nothing_that_its_base_does_not(robot_in):
    driven = robot_in(room(boxes=[Box(name="column", at=(0.4, 0.0), size=(0.2, 0.2, 2.0))]))
    driven.wait(0.1)
    assert not driven.robot.physics.contacts()


def test_an_arm_contact_is_reported(robot_in):
    driven = robot_in(room(boxes=[Box(name="column", at=(0.8, -0.1), size=(0.2, 0.2, 2.0))]))
    driven.robot.player.start("point", driven.now)
    touched = set()
    for _ in range(300):
        driven.wait(0.02)
        touched |= {(contact.part, contact.other) for contact in driven.robot.physics.contacts()}
    assert ("robot forearm", "column") in touched


def test_an_arm_that_is_out_stops_the_base(robot_in):
    driven = robot_in(room())
    driven.robot.player.positions.update(STRETCHED)
    driven.drive(Twist(0.3), 6.0)
    assert driven.robot.physics.pose.x < 1.3
    assert {contact.part for contact in driven.robot.physics.contacts()} == {"robot hand"}
