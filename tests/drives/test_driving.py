"""Simulated driving with delay, limits and a noisy laser: no contact, and the robot passes doors."""

from __future__ import annotations

import math

import pytest

from robots.shared.geometry.poses import Pose, Velocity
from robots.shared.records.verdict import Verdict
from tests.gate.conftest import LASER, box_profile, tiago_profile
from tests.gate.world import World, doorway, leg, wall

SEEDS = [1]  # script/bench gate-world uses many seeds
FULL = Velocity(1.0, 0.0, 0.0)
HALF = Velocity(0.5, 0.0, 0.0)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("stick", [FULL, HALF], ids=["1 m/s", "0.5 m/s"])
@pytest.mark.parametrize("slant_deg", [0, 45, 80])
def test_full_stick_at_a_wall_ends_short_of_it(stick, slant_deg, seed):
    cos, sin = math.cos(math.radians(slant_deg)), math.sin(math.radians(slant_deg))
    world = World(tiago_profile(), wall(2.5 + 5 * sin, -5 * cos, 2.5 - 5 * sin, 5 * cos), seed)
    verdict = world.drive(stick, 8.0)
    assert world.least_gap_m > 0.0
    assert verdict.code == "obstacle"
    if slant_deg == 0:
        assert world.gate.standstill(world.now_s)
        assert 0.0 < world.true_gap() < 0.15, "it need not stop a long way off"


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("stick", [FULL, HALF], ids=["1 m/s", "0.5 m/s"])
@pytest.mark.parametrize("offset", [0.0, 0.19, 0.26, -0.25, 0.28], ids=lambda y: f"y={y}")
def test_a_table_leg_off_the_middle_is_not_touched(stick, offset, seed):
    world = World(tiago_profile(), leg(2.0, offset), seed)
    world.drive(stick, 8.0)
    assert world.least_gap_m > 0.0


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("degrees", [45, 90, -60])
@pytest.mark.parametrize("w", [0.4, 0.9])
def test_a_table_leg_on_an_arc_is_not_touched(degrees, w, seed):
    stick = Velocity(0.7, 0.0, math.copysign(w, degrees))
    rho, along = 0.7 / stick.w, math.radians(degrees)
    world = World(
        tiago_profile(),
        leg(rho * math.sin(abs(along)) * math.copysign(1, rho), rho * (1 - math.cos(along))),
        seed,
    )
    world.drive(stick, 6.0)
    assert world.least_gap_m > 0.0


@pytest.mark.parametrize("seed", SEEDS)
def test_swinging_the_stick_in_front_of_a_wall_touches_nothing(seed):
    world = World(tiago_profile(), wall(2.0, -6, 2.0, 6), seed)

    def swinging(world):
        return Velocity(1.0, 0.0, 2.0 * math.copysign(1.0, math.sin(2.2 * world.now_s)))

    world.drive(swinging, 15.0)
    assert world.least_gap_m > 0.0


@pytest.mark.parametrize("seed", SEEDS)
def test_turning_away_late_from_a_wall_touches_nothing(seed):
    """The base needs time to change its arc."""
    for turn_at_m in (1.2, 1.0, 0.8, 0.6):
        world = World(tiago_profile(), wall(3.0, -6, 3.0, 6), seed)

        def late(world, turn_at_m=turn_at_m):
            near = 3.0 - world.pose.x - 0.27 < turn_at_m
            return Velocity(1.0, 0.0, 2.0 if near and world.pose.yaw < 1.57 else 0.0)

        world.drive(late, 6.0)
        assert world.least_gap_m > 0.0


def towards(x, y, speed):
    """A driver who steers to a point."""

    def stick(world):
        error = math.atan2(y - world.pose.y, x - world.pose.x) - world.pose.yaw
        return Velocity(speed, 0.0, max(-1.5, min(1.5, 2.0 * math.remainder(error, math.tau))))

    return stick


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("width", [0.90, 0.80, 0.70])
def test_a_door_is_passed_without_touching_it(width, seed):
    world = World(tiago_profile(), doorway(2.0, width), seed, pose=Pose(0.0, 0.1, 0.0))

    def driver(world):
        goal = (1.4, 0.0) if world.pose.x < 0.9 else (4.5, 0.0)
        return towards(*goal, 0.6)(world)

    world.drive(driver, 9.0)
    assert world.pose.x > 3.0, f"stuck at {world.pose}"
    assert world.least_gap_m > 0.0


@pytest.mark.parametrize("seed", SEEDS)
def test_a_door_of_80_cm_costs_no_time(seed):
    def seconds_to(world):
        while world.pose.x < 3.0 and world.steps < 1500:
            world.drive(towards(5.0, 0.0, 0.5), 0.05)
        return world.steps

    with_door = seconds_to(World(tiago_profile(), doorway(2.0, 0.80), seed))
    without = seconds_to(World(tiago_profile(), wall(50, 0, 50, 1), seed))
    assert with_door <= 1.05 * without


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("slant_deg", [0, 20])
def test_reversing_into_a_wall_ends_short_of_it_by_sonar(slant_deg, seed):
    cos, sin = math.cos(math.radians(slant_deg)), math.sin(math.radians(slant_deg))
    world = World(tiago_profile(), wall(-0.8 - 3 * sin, -3 * cos, -0.8 + 3 * sin, 3 * cos), seed)
    verdict = world.drive(Velocity(-0.2, 0.0, 0.0), 8.0)
    assert world.least_gap_m > 0.0
    assert verdict.code == "obstacle" and verdict.side in {"behind", "behind left", "behind right"}
    assert "sonar" in verdict.text


@pytest.mark.parametrize("seed", SEEDS)
def test_nose_at_the_wall_the_robot_turns_and_leaves(seed):
    world = World(tiago_profile(), wall(1.5, -5, 1.5, 5), seed)
    world.drive(FULL, 5.0)
    assert world.gate.standstill(world.now_s)
    verdict = world.drive(Velocity(0.5, 0.0, 1.0), 0.5)
    assert verdict.velocity.w == pytest.approx(1.0, abs=0.3), "rotation is given back"
    world.drive(Velocity(0.5, 0.0, 1.0), 3.0)
    world.drive(Velocity(0.5, 0.0, 0.0), 1.0)
    assert world.least_gap_m > 0.0
    assert world.true_gap() > 0.2, "it got away"


@pytest.mark.parametrize("seed", SEEDS)
def test_nose_at_the_wall_the_robot_backs_off(seed):
    world = World(tiago_profile(), wall(1.5, -5, 1.5, 5), seed)
    world.drive(FULL, 5.0)
    gap = world.true_gap()
    verdict = world.drive(Velocity(-0.2, 0.0, 0.0), 2.0)
    assert verdict.code == "free"
    assert world.true_gap() > gap + 0.2


def test_the_robot_drives_along_a_wall_within_the_margin():
    """A laser that sees in all directions also measures the space next to the hull."""
    seeing = tiago_profile(scan_poses={LASER: (0.0, 0.0, 0.0)})
    world = World(seeing, wall(-5, 0.285, 15, 0.285), half_view=math.pi * 0.999, beams=720, noise_m=0.0)
    world.drive(HALF, 10.0)
    assert world.pose.x > 0.7
    assert world.least_gap_m > 0.0


@pytest.mark.parametrize("seed", SEEDS)
def test_the_robot_leaves_a_wall_within_laser_noise(seed):
    world = World(tiago_profile(), wall(-5, 0.29, 15, 0.29), seed)
    world.drive(lambda world: Velocity(0.4, 0.0, -1.0 if world.pose.yaw > -0.4 else 0.0), 5.0)
    assert world.true_gap() > 0.2
    assert world.least_gap_m > 0.0


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("delay_s", [0.1, 0.15])
def test_the_assumed_latency_may_be_used_up(delay_s, seed):
    """Scan age up to 0.1 s, tick 0.05 s, and the delay: 0.3 s in the worst case, 0.2 s on average."""
    world = World(tiago_profile(), wall(2.5, -5, 2.5, 5), seed, delay_s=delay_s)
    world.drive(FULL, 6.0)
    assert world.least_gap_m > 0.0


def box_world(segments, seed):
    return World(box_profile(), segments, seed, half_view=math.pi * 0.999, beams=720)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("w", [0.0, 0.5, -0.8])
def test_a_box_stops_before_a_wall(w, seed):
    world = box_world(wall(2.0, -4, 2.0, 4) + wall(-4, 2.0, 4, 2.0) + wall(-4, -2.0, 4, -2.0), seed)
    world.drive(Velocity(0.8, 0.0, w), 8.0)
    assert world.least_gap_m > 0.0


@pytest.mark.parametrize("seed", SEEDS)
def test_a_box_drives_a_corridor_without_turning_into_walls(seed):
    corridor = wall(-5, 0.4, 15, 0.4) + wall(-5, -0.4, 15, -0.4)
    world = box_world(corridor, seed)
    verdict = world.drive(Velocity(0.0, 0.0, 1.0), 3.0)
    assert world.least_gap_m > 0.0
    assert verdict.code == "obstacle" and "turning" in verdict.text
    turned = world.pose.yaw
    assert 0.05 < turned < 0.6
    world.drive(lambda world: Velocity(0.0, 0.0, -1.0 if world.pose.yaw > 0.02 else 0.0), 3.0)
    assert abs(world.pose.yaw) < 0.12, "turning back stays legal"
    world.drive(lambda world: Velocity(0.4, 0.0, -1.5 * world.pose.yaw - 0.8 * world.pose.y), 8.0)
    assert world.pose.x > 1.0
    assert world.least_gap_m > 0.0


def test_without_the_gate_this_world_does_crash():
    """Show that these tests detect a crash: on the same course, the asked twist goes directly to the base."""
    world = World(tiago_profile(), wall(2.5, -5, 2.5, 5))
    world.gate.decide = lambda asked, sent, now_s: unrestrained(asked)
    world.drive(FULL, 4.0)
    assert world.least_gap_m < 0.0


def unrestrained(asked):
    return Verdict(asked, asked, "free", "")
