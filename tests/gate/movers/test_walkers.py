"""People on two shins: drawn by seeds of the bench, and the crossing in which the robot once touched a person."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.world.cases.walkers import MOVING_MPS
from benchmarks.world.controllers import GateController, PassThrough
from benchmarks.world.walkers import gait
from benchmarks.world.walkers import plan as plans
from benchmarks.world.walkers.plane import Things
from benchmarks.world.walkers.run import Run
from robots.shared.geometry.poses import Velocity
from tests.gate.conftest import tiago_profile

PROFILE = tiago_profile(sonar_poses={}, sonar_fov={})
AHEAD_M, MEETS_S = 2.0, plans.WARM_UP_S + 2.5  # the robot would be there then
# Without a gate all are hit: a turning person, a hesitating one; hidden by a desk, from the front and from the side
DRAWN = [0, 3, 5, 6, 45, 1158, 1168]


def played(plan, seed, controller=lambda fan: GateController(PROFILE, fan)):
    return Run(plan, controller, seed).play()


def crossing(mps, side, phase_m):
    """A person crosses the way of a robot that asks for 1.0 m/s; its laser sees 190 degrees.

    `phase_m`: moves the steps along the way, so that another shin swings when they meet.
    """
    drawn = plans.drawn(0)
    path = gait.way(mps * MEETS_S + 4.0, 0.0, 1.0, 1.0)
    path = gait.moved(path, AHEAD_M, 0.0, side * math.pi / 2.0, mps * MEETS_S + phase_m)
    lengths = phase_m + mps * np.arange(0.0, MEETS_S + plans.GOES_ON_S, gait.STEP_S)
    walk = gait.Walk(plans.ADULT, path, lengths, gait.step_length(mps, plans.ADULT))
    laser = drawn.laser._replace(view=math.radians(190.0), step=math.radians(0.33), hz=10.0)
    return replace(
        drawn, walks=(walk,), asked=Velocity(1.0, 0.0, 0.0), meets_s=MEETS_S, laser=laser, things=Things()
    )


@pytest.mark.parametrize(("side", "phase_m"), [(-1, 0.0), (1, 0.3)], ids=["from the left", "from the right"])
def test_a_robot_stands_before_a_crossing_person_with_swinging_legs(side, phase_m):
    plan = crossing(1.2, side, phase_m)
    unhindered = played(plan, 1, lambda _fan: PassThrough())
    assert unhindered.met.mps > 0.9
    ended = played(plan, 1)
    assert ended.met is None or ended.met.mps <= MOVING_MPS
    said = [moment for moment in ended.moments if moment.code == "mover"]
    assert said
    assert any("moving at 1." in moment.text for moment in said)


@pytest.mark.parametrize("seed", DRAWN)
def test_a_robot_stands_before_people_drawn_by_seed(seed):
    plan = plans.drawn(seed)
    unhindered = played(plan, seed, lambda _fan: PassThrough())
    assert unhindered.met.mps > 0.3
    ended = played(plan, seed)
    assert ended.met is None or ended.met.mps <= MOVING_MPS


@pytest.mark.parametrize("seed", [0, 2013, 2044], ids=["empty", "legs far away", "a leg that flickers"])
def test_nothing_moves_in_a_still_room(seed):
    ended = played(plans.drawn(seed, alone=True), seed)
    assert {moment.code for moment in ended.moments} <= {
        "idle",
        "free",
        "near_miss",
        "obstacle",
        "robot_late",
    }


def test_a_person_who_walks_ahead_may_be_followed():
    plan = crossing(1.2, 1, 0.0)
    [walk] = plan.walks
    same_way = replace(walk, way=gait.moved(walk.way, 1.2, 0.0, 0.0, float(walk.length_m[0])))
    ended = played(replace(plan, walks=(same_way,)), 1)
    assert min(moment.sent.vx for moment in ended.moments if moment.time_s > 2.0) > 0.95
