"""The robot keeps away from sonar echoes until a sensor that covers the place shows it free."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.bridge.gate.gate import Gate
from robots.bridge.gate.obstacles.depth_camera import frame_of
from robots.bridge.gate.obstacles.sonar_memory import MOST
from robots.bridge.gate.values import LaserScan
from robots.shared.configuration.gate_profile import DepthView
from robots.shared.geometry.poses import STILL, Pose, Velocity
from tests.gate.conftest import LASER, SONARS, Feeder, tiago_profile
from tests.gate.depth_pictures import FLOOR, LOOK_AHEAD, camera, picture
from tests.gate.world import World, leg, wall

REVERSE = Velocity(-0.2, 0.0, 0.0)
FAR = wall(50, 0, 50, 1)
HULL_M = 0.27


def legs(*places):
    return [segment for place in places for segment in leg(*place)]


def shins(x, y):
    return legs((x, y - 0.1, 0.08), (x, y + 0.1, 0.08))


def chair(x, y):
    return legs((x, y - 0.2, 0.03), (x, y + 0.2, 0.03), (x - 0.4, y - 0.2, 0.03), (x - 0.4, y + 0.2, 0.03))


BEHIND = {
    "leg": leg(-0.59, 0.0),
    "leg to the side": leg(-0.57, 0.06),
    "thin leg at the rim": leg(-0.67, 0.1, 0.02),
    "leg of a sonar at the corner": leg(-0.52, 0.17),
    "shins": shins(-0.85, 0.04),
    "shins near by": shins(-0.5, 0.1),
    "chair": chair(-0.9, 0.05),
    "chair on one side": chair(-0.62, 0.22),
    "leg 0.7 m behind": leg(-1.0, 0.13, 0.03),
}


def full_reverse(world, seconds=10.0):
    """Park before an obstacle that only sonars detect, then reverse. False: no sonar detected it before."""
    world.drive(STILL, 4.0)
    if not world.heard:
        return False
    world.drive(REVERSE, seconds)
    return True


@pytest.mark.parametrize("degrees", [15, 28.6, 60])
@pytest.mark.parametrize("thing", BEHIND)
def test_a_heard_thing_is_not_touched_after_its_cone_lost_it(thing, degrees):
    world = World(tiago_profile(), BEHIND[thing], sonar_cone=math.radians(degrees))
    if full_reverse(world):
        assert world.least_gap_m > 0.0
        assert world.gate.standstill(world.now_s)


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("thing", ["leg", "leg to the side", "shins", "shins near by", "leg 0.7 m behind"])
def test_noise_and_lost_echoes_do_not_let_the_robot_creep(thing, seed):
    world = World(tiago_profile(), BEHIND[thing], seed, sonar_noise_m=0.03, lost_echoes=0.3)
    if full_reverse(world, 20.0):
        assert world.least_gap_m > 0.0


def test_a_person_who_left_does_not_hold_the_robot():
    world = World(tiago_profile(), shins(-0.8, 0.04))
    full_reverse(world)
    at = world.pose.x
    world.put(FAR)
    world.drive(REVERSE, 1.5)
    assert world.pose.x < at - 0.03, "it drives again within a second"
    world.drive(REVERSE, 5.0)
    assert world.pose.x < at - 0.5, "and goes on"


def test_a_passer_behind_a_parked_robot_does_not_hold_it():
    world = World(tiago_profile(), FAR)
    for step in range(21):
        world.put(shins(-0.8, 1.0 - 0.1 * step))
        world.drive(STILL, 0.1)
    world.put(FAR)
    world.drive(STILL, 1.0)
    world.drive(REVERSE, 4.0)
    assert world.pose.x < -0.3


def test_driving_away_and_turning_stay_allowed():
    world = World(tiago_profile(), BEHIND["shins near by"])
    full_reverse(world)
    verdict = world.drive(Velocity(0.0, 0.0, 1.0), 1.0)
    assert verdict.velocity.w == pytest.approx(1.0)
    world.drive(Velocity(0.0, 0.0, -1.0), 1.0)
    world.drive(STILL, 1.0)
    verdict = world.drive(Velocity(0.3, 0.0, 0.0), 1.0)
    assert verdict.code == "free"
    assert verdict.velocity.vx == pytest.approx(0.3)


def test_an_echo_is_called_remembered_once_its_sonar_is_silent():
    world = World(tiago_profile(), BEHIND["leg to the side"], sonar_cone=math.radians(15))
    full_reverse(world)
    text = world.drive(REVERSE, 0.1).text
    assert "sonar" in text and "behind" in text


def test_the_middle_of_another_cone_clears_and_its_rim_does_not():
    world = World(tiago_profile(), leg(-0.95, 0.0, 0.2))
    world.drive(STILL, 1.0)
    world.put(FAR)
    world.drive(lambda world: Velocity(0.4, 0.0, 0.0), 0.5)  # away from the echo
    world.drive(STILL, 2.0)
    places = world.gate.obstacles(world.now_s).points
    assert len(places), "the rim of the cone tells nothing"
    assert (abs(places[:, 1]) > 0.08).all()


def test_out_of_reach_is_forgotten():
    world = World(tiago_profile(), leg(-0.95, 0.0, 0.2))
    world.drive(STILL, 1.0)
    world.put(FAR)
    world.drive(Velocity(1.0, 0.0, 0.0), 2.5)
    assert not len(world.gate.obstacles(world.now_s).points)


def test_after_a_jump_of_the_odometry_nothing_is_remembered():
    world = World(tiago_profile(), leg(-0.95, 0.0, 0.2))
    world.drive(STILL, 1.0)
    world.put(FAR)
    world.pose = Pose(3.0, 0.0, 0.0)
    world.drive(STILL, 0.3)
    assert not len(world.gate.obstacles(world.now_s).points)


def test_without_a_camera_the_laser_clears_sonar_echoes():
    """After a turn the laser sees that the person has left."""
    world = World(tiago_profile(), shins(-0.9, 0.0))
    world.drive(STILL, 2.0)
    world.put(FAR)
    world.drive(lambda world: Velocity(0.0, 0.0, 2.0 if world.pose.yaw < math.pi - 0.3 else 0.0), 3.0)
    assert not len(world.gate.obstacles(world.now_s).points)


@pytest.mark.parametrize("other_hz", [10, 25, 40])
@pytest.mark.parametrize("sonar_hz", [4, 10])
@pytest.mark.parametrize("other", ["laser", "depth"])
def test_no_other_sensor_removes_a_current_sonar_echo(other, sonar_hz, other_hz):
    """The obstacle may be glass, which only sonars detect, or a seat above the laser's plane."""
    view = DepthView(1.10) if other == "depth" else None
    ahead = {"ahead": (0.25, 0.0, 0.0)}
    gate = Gate(
        tiago_profile(sonar_poses=ahead, sonar_fov={"ahead": 0.5}, has_depth=view is not None, depth=view)
    )
    to_base = camera(LOOK_AHEAD)
    frame = frame_of(picture([FLOOR], to_base), to_base, view) if view else None
    nothing = np.full(571, math.inf)
    for step in range(600):
        now_s = 100.0 + 0.005 * step
        if step % 4 == 0:
            gate.observe_odometry(now_s, now_s, Pose(0.0, 0.0, 0.0), STILL)
        if step % (200 // (10 if frame else other_hz)) == 0:
            gate.observe_scan(LaserScan(LASER, now_s, now_s, nothing, -1.66, 3.32 / 570, 0.05, 25.0))
        if frame and step % (200 // other_hz) == 0:
            gate.observe_depth(frame, now_s, now_s)
        if step % (200 // sonar_hz) == 0:
            gate.observe_range("ahead", now_s, now_s, 0.9, 1.0)
        if step % 10 == 5:
            known = gate.obstacles(now_s)
            assert len(known.points), f"{step / 200} s after the first echo"


def test_sonars_whose_stamps_differ_do_not_make_the_way_longer():
    """Echoes are forgotten after 4 m of driving, not 1.4 m."""
    gate = Gate(tiago_profile())
    for step in range(400):
        now_s = 100.0 + 0.01 * step
        way_m = min(0.4 * (now_s - 100.0), 1.4)
        gate.observe_odometry(now_s, now_s, Pose(way_m, 0.0, 0.0), Velocity(0.4, 0.0, 0.0))
        if step == 0:
            gate.observe_range("base_sonar_01_link", now_s, now_s, 0.2, 1.0)
        elif step % 10 == 5:
            for late, name in enumerate(SONARS):
                gate.observe_range(name, now_s - 0.1 * late, now_s, math.inf, 1.0)
    assert len(gate.obstacles(now_s).points), "out of every cone, 1.8 m behind"


def test_an_odometry_that_trembles_adds_no_distance():
    """The poses have 2 mm of noise, at 10 Hz, for ten minutes."""
    gate, random = Gate(tiago_profile()), np.random.default_rng(0)
    for step in range(6000):
        now_s = 100.0 + 0.1 * step
        gate.observe_odometry(now_s, now_s, Pose(*random.normal(0.0, 0.002, 3)), STILL)
        for name in SONARS:
            heard = step == 0 and name == "base_sonar_02_link"
            gate.observe_range(name, now_s, now_s, 0.1 if heard else math.inf, 1.0)
    assert len(gate.obstacles(now_s).points), "the rim of its cone"


def test_far_echoes_do_not_push_out_a_near_leg():
    """Turning on the spot between table legs overfills the list of places within half a turn."""
    # No leg behind the near one
    places = [(0.9 * math.cos(yaw), 0.9 * math.sin(yaw), 0.03) for yaw in np.linspace(-2.6, 2.6, 13)]
    world = World(tiago_profile(has_depth=True), leg(-0.55, 0.0) + legs(*places), 1, sonar_noise_m=0.03)
    world.drive(STILL, 3.0)
    world.drive(Velocity(0.0, 0.0, 0.4), 13.0)
    kept = world.gate._echoes.all_places()
    assert len(kept) == MOST
    assert np.hypot(kept[:, 0] + 0.55, kept[:, 1]).min() < 0.06


class Trembling(World):
    """A parked robot with noisy odometry, as from sensor fusion."""

    @property
    def odometry(self):
        x, y, yaw = np.random.default_rng(self.steps).normal(0.0, 0.002, 3)
        return Pose(self.pose.x + x, self.pose.y + y, self.pose.yaw + yaw)


@pytest.mark.parametrize("seed", range(4))
def test_with_noisy_odometry_an_echo_counts_as_from_one_place(seed):
    """Then the missing echo from that place shows that the person has left."""
    world = Trembling(tiago_profile(has_depth=True), shins(-0.8, 0.04))
    world.steps = 100_000 * seed
    full_reverse(world)
    world.put(FAR)
    world.drive(STILL, 3.0)
    assert not len(world.gate._echoes.all_places())


def test_with_noisy_odometry_departed_people_do_not_hold_it():
    world = Trembling(tiago_profile(has_depth=True), shins(-0.8, 0.04))
    full_reverse(world)
    at = world.pose.x
    world.put(FAR)
    world.drive(REVERSE, 10.0)
    assert world.pose.x < at - 0.5


@pytest.mark.parametrize("degrees", [15, 28.6, 60])
@pytest.mark.parametrize("thing", BEHIND)
def test_trembling_odometry_takes_nothing_out_of_memory(thing, degrees):
    world = Trembling(tiago_profile(), BEHIND[thing], sonar_cone=math.radians(degrees))
    if full_reverse(world):
        assert world.least_gap_m > 0.0


@pytest.mark.parametrize("turns", [False, True])
def test_an_echo_that_moves_along_names_its_sonar_and_the_remedy(turns):
    """The cause is crosstalk, a cable in the cone, or the robot's skirt. The gate stops reverse and explains it."""
    inputs = Feeder(tiago_profile())
    name = "base_sonar_02_link"

    def at(pose, range_m):
        inputs.now_s += 0.2
        inputs.pose = pose
        inputs.scan()
        inputs.odometry()
        for sonar in SONARS:
            heard_m = range_m if sonar == name else 1.0
            inputs.gate.observe_range(sonar, inputs.stamp_s, inputs.now_s, heard_m, 1.0)
        state = {health.name: health for health in inputs.gate.sensor_health(inputs.now_s)}
        assert all(health.ok for health in state.values() if health.name != name)
        return state[name], inputs.gate.decide(REVERSE, STILL, inputs.now_s)

    def gone(step):
        return Pose(0.0, 0.0, 0.2 * step) if turns else Pose(0.05 * step, 0.0, 0.0)

    for step in range(5):
        health, verdict = at(gone(step), 0.05)
        assert health.ok and verdict.velocity == STILL and "wherever" not in verdict.text
    for step in range(5, 10):
        health, verdict = at(gone(step), 0.04 + 0.01 * (step % 3))
    why = f"{name} reports 0.04 m wherever the robot goes: clean it, remove objects in front of it, or remove it"
    assert not health.ok and health.text.startswith(why)
    assert verdict.velocity == STILL, "it stays an obstacle"
    assert verdict.text.startswith("stopped (0.2 m/s asked): sonar, ") and why in verdict.text
    assert at(gone(9), 0.3)[0].ok, "an obstacle comes and goes"


def test_a_close_obstacle_explains_no_echo_until_it_is_left():
    world = World(tiago_profile(), leg(-0.34, 0.0))
    world.drive(STILL, 20.0)
    world.drive(REVERSE, 5.0)
    world.drive(Velocity(0.3, 0.0, 0.0), 3.0)
    assert all(health.ok for health in world.gate.sensor_health(world.now_s))
