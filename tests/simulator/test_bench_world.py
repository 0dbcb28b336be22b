"""The bench that judges the gate sees crashes where there are some, and judges by the true world."""

from __future__ import annotations

import math

import pytest

from benchmarks.world import doors, objects
from benchmarks.world.judge import kept
from benchmarks.world.loop import Case, Moment, Trace
from benchmarks.world.play import at_most, loop_of
from benchmarks.world.truth import Truth
from robots.bridge.gate.values import STILL, Velocity
from robots.simulator.base import Twist
from robots.simulator.body import TIAGO
from robots.simulator.physics import Physics, Pose
from robots.simulator.worlds import Box, World

ORIGIN = Pose(0.0, 0.0, 0.0)
AHEAD = Velocity(1.0, 0.0, 0.0)


def played(controller: str, thing: str, angle: int, share: float = 1.0, seed: int = 0) -> Trace:
    case = objects.build(objects.Full(controller, thing, angle, share, seed))
    return loop_of(case, controller, seed).play()


def box_at(x: float, y: float, size: tuple[float, float, float] = (0.2, 0.2, 0.5), z: float = 0.0) -> Physics:
    box = Box(name="box", at=(x, y), size=size, z=z)
    return Physics(World(name="w", size=(-9.0, -9.0, 9.0, 9.0), boxes=[box]), TIAGO, ORIGIN)


@pytest.mark.parametrize(
    ("thing", "angle"), [("wall", 0), ("table leg", 45), ("person", 180), ("table top", 0)]
)
def test_without_a_gate_full_stick_ends_at_the_object(thing, angle):
    touches = played("none", thing, angle).touches
    assert touches[0].other.startswith(thing.split()[-1] if thing == "table leg" else thing.split()[0])


def test_the_gate_stops_before_a_wall_and_the_last_published_twist_is_zero():
    trace = played("gate", "wall", 0)
    assert not trace.touches
    assert trace.moments[-1].sent.vx == 0.0
    assert trace.moments[-1].gap_m < 0.2


def test_the_cone_and_the_monitor_do_not_see_a_table_top():
    assert played("cone", "table top", 0).touches
    assert played("monitor", "table top", 0).touches


def test_the_same_seed_gives_the_same_run():
    first, again = (played("gate", "table leg", 45, 0.5, seed=3) for _ in range(2))
    assert first.moments == again.moments


def test_a_competent_driver_passes_the_narrowest_door_without_help():
    trace = loop_of(doors.build(0.64, 1), "none", 1).play()
    assert trace.arrived
    assert not trace.touches


def test_the_true_way_is_free_up_to_what_stands_in_it():
    truth = Truth(box_at(1.5, 0.0))
    assert truth.free_m(ORIGIN, AHEAD, 3.0) == pytest.approx(1.4 - 0.27 - 0.05, abs=0.05)
    assert truth.free_m(ORIGIN, Velocity(-0.2, 0.0, 0.0), 3.0) == 3.0
    assert truth.free_m(Pose(0.0, 0.0, math.pi), Velocity(-0.2, 0.0, 0.0), 3.0) < 1.2


def test_an_arc_meets_what_a_line_passes():
    truth = Truth(box_at(1.0, 1.0))
    assert truth.free_m(ORIGIN, AHEAD, 3.0) == 3.0
    assert truth.free_m(ORIGIN, Velocity(1.0, 0.0, 1.0), 3.0) < 1.4


def test_what_hangs_above_the_robot_is_not_in_its_way():
    assert Truth(box_at(1.0, 0.0, z=1.3)).free_m(ORIGIN, AHEAD, 3.0) == 3.0


def moments(sent_mps: float) -> Trace:
    """Two seconds of full stick ahead at the origin, with this published."""
    asked, sent = AHEAD, Velocity(sent_mps, 0.0, 0.0)
    return Trace(
        [Moment(0.05 * n, ORIGIN, Twist(), asked if n else STILL, sent, "", "", 1.0, True) for n in range(41)]
    )


def test_standing_in_the_open_is_a_false_stop_and_before_a_box_is_none():
    limits = loop_of(objects.build(objects.Full("none", "wall", 0, 1.0, 0)), "none", 0).limits
    in_the_open = kept(moments(0.0), Truth(box_at(4.0, 0.0)), limits)
    assert in_the_open.false_stops == in_the_open.free > 0
    assert in_the_open.lost_percent == 100.0
    assert kept(moments(1.0), Truth(box_at(4.0, 0.0)), limits).lost_percent == pytest.approx(0.0)
    assert kept(moments(0.0), Truth(box_at(0.6, 0.0)), limits).free == 0


def test_every_case_leaves_room_where_it_begins():
    for full in objects.cases("none", 1):
        case: Case = objects.build(full)
        assert Physics(case.world, TIAGO, ORIGIN).clearance_m() >= objects.NEAREST_M, full


def test_bounds_are_poissons():
    assert at_most(0) == pytest.approx(3.0, abs=0.005)
    assert at_most(1) == pytest.approx(4.744, abs=0.005)
