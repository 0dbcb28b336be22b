"""Points out of view are remembered for a while; points seen to be gone are forgotten."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.bridge.gate.obstacles.laser_memory import LaserMemory
from robots.bridge.gate.obstacles.point_memory import (
    BRIEFLY_S,
    DEPTH_LAYER,
    GAP_S,
    LASER_LAYER,
    LONG_S,
    PASSES,
    Layer,
    Memory,
    moved_nearer,
)
from robots.bridge.gate.obstacles.sightings import sight
from robots.bridge.gate.obstacles.sources import Laser
from robots.bridge.gate.sensing.scan import Sweep
from robots.bridge.gate.timing.trail import Trail
from robots.bridge.gate.values import LaserScan
from robots.shared.configuration.gate_profile import Limits
from robots.shared.geometry.footprint import Disc
from robots.shared.geometry.planar import ORIGIN, placed, relative_to
from robots.shared.geometry.poses import STILL, Pose, Velocity
from tests.drives.test_driving import towards
from tests.gate.conftest import LASER, box_profile, tiago_profile
from tests.gate.world import World, doorway, leg, wall

NAN, INF = math.nan, math.inf
HERE = Pose(0.0, 0.0, 0.0)
TURNED_AWAY = Pose(0.0, 0.0, math.pi)
SPOT = np.array([[1.0, 0.5]])


def watched(layer, seconds, period_s=0.1):
    """A memory that saw SPOT for `seconds`, until now."""
    memory = Memory(layer)
    for number in range(round(seconds / period_s) + 1):
        memory.see(SPOT, HERE, number * period_s)
    return memory


# --- the grid -------------------------------------------------------------------------------------


@pytest.mark.parametrize("layer", [LASER_LAYER, DEPTH_LAYER], ids=["laser", "depth"])
@pytest.mark.parametrize("seconds", [0.0, 0.5])
def test_a_briefly_seen_point_has_the_shortest_life(layer, seconds):
    memory = watched(layer, seconds)
    assert len(memory.points(seconds + layer.shortest_life_s - 0.01)) == 1
    assert len(memory.points(seconds + layer.shortest_life_s + 0.01)) == 0


@pytest.mark.parametrize("layer", [LASER_LAYER, DEPTH_LAYER], ids=["laser", "depth"])
@pytest.mark.parametrize("period_s", [0.025, 0.1])
def test_long_seen_points_live_longest_at_any_scan_rate(layer, period_s):
    memory = watched(layer, 3.0, period_s)
    assert len(memory.points(3.0 + layer.longest_life_s - 0.01)) == 1
    assert len(memory.points(3.0 + layer.longest_life_s + 0.01)) == 0


def test_life_grows_with_the_time_of_watching():
    memory = watched(LASER_LAYER, 1.3)
    assert len(memory.points(1.3 + 15.9)) == 1
    assert len(memory.points(1.3 + 16.1)) == 0


def test_two_ghosts_in_one_place_do_not_count_as_seen():
    memory = Memory(LASER_LAYER)
    memory.see(SPOT, HERE, 0.0)
    memory.see(SPOT, HERE, 1.9)
    assert len(memory.points(4.0)) == 0


def test_after_six_metres_older_points_are_forgotten():
    memory = watched(LASER_LAYER, 3.0)
    for step in range(59):  # forwards and backwards, so that only the way driven counts
        memory.follow(Pose(0.1 * ((step + 1) % 2), 0.0, 0.0), 3.0)
    assert len(memory.points(3.0)) == 1
    memory.follow(HERE, 3.0)
    memory.follow(Pose(0.11, 0.0, 0.0), 3.0)
    assert len(memory.points(3.0)) == 0


def test_near_points_are_forgotten_only_by_driving_away():
    """Random seed 194: the robot forgot a table top 0.55 m behind it after 20 s of turning, and backed into it."""
    memory = Memory(DEPTH_LAYER)
    memory.see(SPOT, HERE, 0.0)
    for second in range(120):
        memory.follow(HERE._replace(yaw=0.1 * second), float(second))
    assert len(memory.points(119.0)) == 1
    away = Pose(-0.5, 0.0, 0.0)
    memory.follow(away, 120.0)
    assert len(memory.points(119.0 + DEPTH_LAYER.shortest_life_s + 0.1)) == 0


def test_near_points_are_remembered_for_twice_the_way():
    memory = Memory(DEPTH_LAYER)
    memory.see(np.array([[0.8, 0.0], [1.5, 0.0]]), HERE, 0.0)
    for step in range(110):  # 11 m, forwards and backwards
        memory.follow(Pose(0.1 * ((step + 1) % 2), 0.0, 0.0), 0.0)
        assert len(memory.points(0.0)) == (2 if step < 60 else 1)
    for step in range(15):
        memory.follow(Pose(0.1 * ((step + 1) % 2), 0.0, 0.0), 0.0)
    assert len(memory.points(0.0)) == 0


def test_doubt_grows_with_way_and_turns_only():
    memory = Memory(DEPTH_LAYER)
    memory.see(SPOT, HERE, 0.0)
    for step in range(1000):
        memory.follow(Pose(0.002 * (step % 2), 0.0, 0.004 * (step % 2)), 0.0)
    np.testing.assert_array_equal(memory.errors_m(np.arange(1)), [0.0])
    memory.follow(Pose(1.0, 0.0, 0.0), 0.0)
    np.testing.assert_array_equal(memory.errors_m(np.arange(1)), [0.0])  # the margins cover the first metre
    memory.follow(Pose(1.5, 0.0, 0.0), 0.0)
    np.testing.assert_allclose(memory.errors_m(np.arange(1)), [0.015])
    memory.follow(Pose(1.5, 0.0, 2.0), 0.0)
    np.testing.assert_allclose(memory.errors_m(np.arange(1)), [0.045])
    memory.see(SPOT, Pose(1.5, 0.0, 2.0), 0.0)
    np.testing.assert_array_equal(memory.errors_m(np.arange(1)), [0.0])


@pytest.mark.parametrize("layer", [LASER_LAYER, DEPTH_LAYER], ids=["laser", "depth"])
def test_a_trembling_odometry_changes_no_memory(layer):
    memory = Memory(layer._replace(shortest_life_s=100.0, longest_life_s=100.0))
    random = np.random.default_rng(0)
    memory.see(SPOT, HERE, 0.0)
    for step in range(1800):  # 60 s at 30 Hz
        memory.follow(Pose(*random.normal(0.0, 0.002, 3)), step / 30.0)
    assert len(memory.points(60.0)) == 1
    np.testing.assert_array_equal(memory.errors_m(np.arange(1)), [0.0])


def test_slow_driving_forgets_with_a_trembling_odometry_too():
    memory = Memory(LASER_LAYER._replace(shortest_life_s=1000.0, longest_life_s=1000.0))
    random = np.random.default_rng(0)
    memory.see(SPOT, HERE, 0.0)
    gone_s = None
    for step in range(10_000):
        x, y, yaw = random.normal(0.0, 0.002, 3)
        back = 1.0 - abs(1.0 - 0.02 * step / 30.0 % 2.0)  # back and forth along 1 m
        memory.follow(Pose(x + back, y, yaw), step / 30.0)
        if gone_s is None and not len(memory.points(step / 30.0)):
            gone_s = step / 30.0
    assert gone_s == pytest.approx(300.0, rel=0.1), "6 m"


def test_doubt_brings_a_point_nearer_but_not_to_the_hull():
    points = np.array([[1.0, 0.0], [0.0, -0.33], [-0.28, 0.0]])
    nearer = moved_nearer(points, np.full(3, 0.05), Disc(0.27))
    np.testing.assert_allclose(nearer, [[0.95, 0.0], [0.0, -0.30], [-0.28, 0.0]])


def test_a_cell_keeps_the_mean_of_its_points():
    memory = Memory(LASER_LAYER)
    memory.see(np.array([[0.501, 0.502], [0.511, 0.512]]), HERE, 0.0)
    np.testing.assert_array_equal(memory.points(0.0), [[0.511, 0.512]])
    for scan in range(20):
        memory.see(np.array([[0.511, 0.512]]), HERE, 0.1 * scan)
    memory.see(np.array([[0.521, 0.512]]), HERE, 2.0)
    np.testing.assert_allclose(memory.points(2.0), [[0.513, 0.512]])
    for scan in range(30):
        memory.see(np.array([[0.521, 0.512]]), HERE, 2.1 + 0.1 * scan)
    np.testing.assert_allclose(memory.points(5.0), [[0.521, 0.512]], atol=1e-4)


def test_far_points_are_neither_remembered_nor_invented():
    memory = Memory(LASER_LAYER)
    width = 256 * 0.025
    memory.see(np.array([[3.0, 0.0], [3.3, 0.0]]), HERE, 0.0)
    assert len(memory.points(0.0)) == 1
    there = Pose(width, 0.0, 0.0)
    memory.see(np.array([[3.0 + width, 0.0]]), there, 0.1)
    np.testing.assert_array_equal(memory.points(0.1), [[3.0 + width, 0.0]])


def test_two_observations_of_free_space_forget_and_one_does_not():
    memory = watched(DEPTH_LAYER, 1.0)
    free = np.array([True])
    memory.pass_through(free)
    assert len(memory.points(1.0)) == 1
    memory.see(SPOT, HERE, 1.1)
    memory.pass_through(free)
    assert len(memory.points(1.1)) == 1, "seen again in between"
    memory.pass_through(free)
    assert len(memory.points(1.1)) == 0


def test_a_new_sighting_after_forgetting_starts_again():
    memory = watched(LASER_LAYER, 5.0)
    memory.clear()
    assert len(memory.points(5.0)) == 0
    memory.see(SPOT, HERE, 5.1)
    assert len(memory.points(7.2)) == 0


def test_the_revision_changes_with_new_and_expired_points():
    memory = watched(LASER_LAYER, 0.0)
    first = memory.revision(0.0)
    assert memory.revision(1.9) == first
    assert memory.revision(2.1) != first


class Naive:
    """The same rules in plain Python, cell by cell."""

    def __init__(self, layer):
        self.layer, self.cells, self.robot, self.way = layer, {}, None, 0.0

    def follow(self, pose, now_s):
        if self.robot:
            self.way += math.hypot(pose.x - self.robot.x, pose.y - self.robot.y)
        self.robot = pose
        self.cells = {key: cell for key, cell in self.cells.items() if self.near(*cell["point"], pose)}
        self.cells = {key: cell for key, cell in self.cells.items() if cell["way"] >= self.way}
        self.expire(now_s)

    def near(self, x, y, pose):
        return max(abs(x - pose.x), abs(y - pose.y)) <= 127 * self.layer.cell_m

    def expire(self, now_s):
        self.cells = {key: cell for key, cell in self.cells.items() if cell["until"] >= now_s}

    def see(self, points, pose, now_s):
        self.follow(pose, now_s)
        before = dict(self.cells)
        for x, y in points:
            if not self.near(x, y, pose):
                continue
            key = math.floor(x / self.layer.cell_m), math.floor(y / self.layer.cell_m)
            old = before.get(key)
            watched = old["watched"] + min(now_s - old["seen"], GAP_S) if old else 0.0
            share = min(max((watched - BRIEFLY_S) / (LONG_S - BRIEFLY_S), 0.0), 1.0)
            life = self.layer.shortest_life_s + share * (
                self.layer.longest_life_s - self.layer.shortest_life_s
            )
            self.cells[key] = {
                "point": (x, y),
                "watched": watched,
                "seen": now_s,
                "until": now_s + life,
                "way": self.way + self.layer.travel_m,
                "passes": 0,
            }

    def pass_through(self, points):
        free = {tuple(point) for point in points}
        for cell in self.cells.values():
            cell["passes"] += cell["point"] in free
        self.cells = {key: cell for key, cell in self.cells.items() if cell["passes"] < PASSES}

    def points(self, now_s):
        self.expire(now_s)
        return sorted(cell["point"] for cell in self.cells.values())


# Unusual cell and step sizes: no value is exactly on a limit, where rounding would decide.
COARSE = Layer(0.55, 3.03, 7.013, cell_m=0.0307)
MOMENTS = st.lists(
    st.tuples(
        st.sampled_from([0.07, 0.11, 0.39]),  # seconds passed
        st.integers(-9, 9),  # steps of the robot along x and y
        st.integers(-9, 9),
        st.integers(0, 2**20),  # which points: few places, so that they repeat
        st.integers(0, 12),  # how many
        st.integers(0, 3),  # points seen through: every n-th
    ),
    max_size=60,
)


@given(MOMENTS, st.sampled_from([(0.0, 0.0), (1234.56, -9876.5), (-31.4, 7.85)]))
def test_the_rolling_grid_equals_a_dictionary(moments, begin):
    memory, naive = Memory(COARSE), Naive(COARSE)
    now_s, (x, y) = 10.0, begin
    for passed_s, dx, dy, seed, count, every in moments:
        now_s, x, y = now_s + passed_s, x + 0.1013 * dx, y + 0.1013 * dy
        pose, random = Pose(x, y, 0.0), np.random.default_rng(seed % 7)
        points = np.array(begin) + random.uniform(-5.0, 5.0, (count, 2))
        memory.see(points, pose, now_s)
        naive.see(points.tolist(), pose, now_s)
        known = memory.points(now_s)
        free = np.zeros(len(known), dtype=bool)
        if every:
            free[::every] = True
        naive.pass_through(known[free].tolist())
        memory.pass_through(free)
        assert sorted(map(tuple, memory.points(now_s).tolist())) == naive.points(now_s)
    assert sorted(map(tuple, memory.points(now_s + 0.6).tolist())) == naive.points(now_s + 0.6)


# --- evidence of one scan -------------------------------------------------------------------------

STEP = math.radians(190) / 570


def sweep(ranges):
    return Sweep(ranges, -math.radians(95), STEP, 0.05, 25.0)


def at(distance_m, degrees):
    angle = math.radians(degrees)
    return np.array([[distance_m * math.cos(angle), distance_m * math.sin(angle)]])


def seen_through(ranges, distance_m, degrees):
    """Return (judged, seen through) for one place."""
    answer = sight(sweep(ranges), at(distance_m, degrees))
    return bool(answer.judged[0]), bool(answer.through[0])


def hall(distance_m=INF):
    return np.full(571, distance_m)


def test_a_place_in_full_view_is_judged_and_seen_through():
    assert seen_through(hall(), 2.0, 30.0) == (True, True)
    assert seen_through(hall(4.0), 2.0, 30.0) == (True, True)


@pytest.mark.parametrize("degrees", [95.5, 120.0, 180.0, -96.0, 94.95])
def test_nothing_is_known_outside_the_field_of_view(degrees):
    assert seen_through(hall(), 2.0, degrees) == (False, False)


def test_a_place_behind_a_hit_is_unknown():
    assert seen_through(hall(1.5), 2.0, 0.0) == (False, False)


def test_a_place_that_the_scan_hits_is_not_seen_through():
    assert seen_through(hall(2.0), 2.0, 0.0) == (True, False)
    assert seen_through(hall(1.95), 2.0, 0.0) == (True, False)
    assert seen_through(hall(2.11), 2.0, 0.0) == (True, False), "a hand's breadth behind is not through"
    assert seen_through(hall(2.13), 2.0, 0.0) == (True, True)


@pytest.mark.parametrize("lost", [NAN, -INF, 0.0, 30.0], ids=str)
@pytest.mark.parametrize("beam", [284, 285, 286])
def test_a_lost_beam_among_the_three_nearest_proves_nothing(lost, beam):
    ranges = hall(4.0)
    ranges[beam] = lost
    assert seen_through(ranges, 2.0, 0.0) == (False, False)
    ranges[285] = ranges[beam]
    assert seen_through(ranges, 2.0, 1.5) == (True, True), "its neighbours still do"


def test_one_noisy_beam_proves_nothing_three_beams_do():
    ranges = hall(NAN)
    ranges[284:287] = [2.3, 2.0, 2.6]
    assert seen_through(np.where(np.isnan(ranges), INF, ranges), 2.0, 0.0) == (False, False)
    ranges[284:287] = [2.3, 2.2, 2.6]
    assert seen_through(np.where(np.isnan(ranges), INF, ranges), 2.0, 0.0) == (True, True)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("beams_off", [-0.4, 0.0, 0.4, 0.9])
def test_a_laser_that_sees_all_round_sees_over_its_seam(beams_off, sign):
    step = math.tau / 720
    ranges = np.full(720, 4.0)
    place = at(2.0, math.degrees(math.pi + beams_off * step))
    answer = sight(Sweep(ranges, -math.pi, sign * step, 0.05, 25.0), place)
    assert answer.judged[0] and answer.through[0]
    ranges[[0, -1]] = 1.0
    answer = sight(Sweep(ranges, -math.pi, sign * step, 0.05, 25.0), place)
    assert not answer.judged[0] and not answer.through[0]


@given(
    st.floats(-math.pi, math.pi),
    st.floats(-math.pi, math.pi),
    st.sampled_from([1.0, -1.0]),
    st.integers(10, 720),
    st.floats(0.3, 1.0),
    st.integers(0, 2**20),
)
def test_sight_agrees_with_asking_beam_by_beam(bearing, start, sign, beams, share, seed):
    random = np.random.default_rng(seed)
    increment = sign * share * math.tau / beams
    ranges = random.choice(
        [1.0, 1.5, 2.05, 3.0, INF, NAN, -INF], beams, p=[0.1, 0.1, 0.2, 0.2, 0.2, 0.1, 0.1]
    )
    try:
        scan = Sweep(ranges, start, increment, 0.05, 25.0)
    except ValueError:
        return
    place = 2.0 * np.array([[math.cos(bearing), math.sin(bearing)]])
    offsets = [abs(math.remainder(start + number * increment - bearing, math.tau)) for number in range(beams)]
    nearest = int(np.argmin(offsets))
    if abs(sorted(offsets)[0] - sorted(offsets)[1]) < 1e-9:
        return  # between two beams, either may be the nearest
    circle = abs(increment) * (beams + 0.5) > math.tau
    three = [nearest - 1, nearest, nearest + 1]
    seen = offsets[nearest] <= abs(increment) / 2
    if circle:
        three = [number % beams for number in three]
    elif not 0 < nearest < beams - 1:
        seen = False
    ends = [scan.ends[number] for number in three] if seen else [-INF]
    through = min(ends) > 2.12
    trusted = seen and not any(scan.alone[number] for number in three) and min(ends) >= 1.9
    answer = sight(scan, place)
    assert (bool(answer.judged[0]), bool(answer.through[0])) == (through or trusted, through)


def test_smoothed_ranges_average_over_one_surface_only():
    ranges = hall()
    ranges[100:105] = [2.00, 2.02, 1.98, 2.01, 1.99]
    ranges[105:108] = [2.5, 2.5, 2.5]
    distances = np.hypot(*sweep(ranges).steadied().T)
    np.testing.assert_allclose(distances[:5], [2.00, 2.0025, 2.00, 2.00, 5.98 / 3])
    np.testing.assert_allclose(distances[5:], 2.5)


# --- a laser's memory -----------------------------------------------------------------------------


def scanned(at_s, ranges):
    return LaserScan("/scan", at_s, at_s, ranges, -math.radians(95), STEP, 0.05, 25.0)


class Bench:
    """A laser at the base origin with its memory, on a robot that the test moves."""

    def __init__(self):
        self.laser = Laser("/scan", "laser", HERE, Disc(0.27))
        self.memory = LaserMemory(self.laser)
        self.trail = Trail(1.0, 20.0)  # no limit on turning
        self.now_s = 100.0

    def look(self, ranges, pose=HERE, seconds=0.1):
        """Feed this scan every 0.1 s for `seconds`."""
        for _ in range(round(seconds / 0.1)):
            self.now_s += 0.1
            self.trail.add(self.now_s, pose, STILL)
            self.laser.observe(scanned(self.now_s, ranges))
            self.memory.learn(self.trail, self.now_s)

    @property
    def remembered(self):
        there = relative_to(ORIGIN, self.trail.newest or ORIGIN)
        return placed(self.memory.places(self.trail, self.now_s), there)


def something(distance_m=1.0, degrees=0.0, beams=5, behind=INF):
    ranges = hall(behind)
    middle = 285 + round(math.radians(degrees) / STEP)
    ranges[middle - beams // 2 : middle + beams // 2 + 1] = distance_m
    return ranges


def test_a_point_in_view_is_not_given_twice():
    bench = Bench()
    bench.look(something(), seconds=1.0)
    assert len(bench.remembered) == 0


def test_a_point_turned_out_of_view_keeps_its_place():
    bench = Bench()
    bench.look(something(1.0, 90.0), seconds=1.0)
    bench.look(hall(), pose=Pose(0.0, 0.0, math.radians(-30)))
    assert len(bench.remembered) > 0
    np.testing.assert_allclose(np.hypot(*bench.remembered.T), 1.0, atol=1e-9)
    np.testing.assert_allclose(np.arctan2(*bench.remembered.T[::-1]), math.radians(120), atol=0.02)


def test_between_scans_memory_moves_with_the_robot():
    bench = Bench()
    bench.look(something(1.0, 90.0), seconds=1.0)
    bench.look(hall(), pose=Pose(0.0, 0.0, math.radians(-30)))
    bench.trail.add(bench.now_s + 0.05, Pose(0.0, 0.4, math.radians(-30)), STILL)
    np.testing.assert_allclose(np.hypot(*bench.remembered.T), 0.6, atol=0.03)


def test_a_point_hidden_behind_a_person_is_remembered():
    bench = Bench()
    bench.look(something(2.0), seconds=1.0)
    bench.look(something(1.0, beams=21))
    assert bench.remembered[:, 0] == pytest.approx(2.0, abs=0.01)


@pytest.mark.parametrize("lost", [NAN, -INF])
def test_a_point_lost_by_the_laser_is_remembered(lost):
    bench = Bench()
    bench.look(something(2.0), seconds=1.0)
    bench.look(something(lost, beams=41))
    assert len(bench.remembered) > 0


def test_a_gone_obstacle_is_dropped_after_two_scans():
    for looks, left in ((1, True), (2, False)):
        bench = Bench()
        bench.look(something(2.0), seconds=3.0)
        bench.look(hall(), seconds=0.1 * looks)
        assert len(bench.remembered) == 0
        bench.look(hall(), pose=Pose(0.0, 0.0, math.pi))
        assert (len(bench.remembered) > 0) == left


def test_a_ghost_of_one_scan_lives_two_seconds():
    bench = Bench()
    bench.look(something(2.0, 80.0, beams=3))
    away = Pose(0.0, 0.0, math.radians(-90))
    bench.look(hall(), pose=away, seconds=1.9)
    assert len(bench.remembered) > 0
    bench.look(hall(), pose=away, seconds=0.2)
    assert len(bench.remembered) == 0


@pytest.mark.parametrize("nearer_m", [0.03, 0.10])
def test_a_wall_that_drifted_is_remembered_where_it_was_seen_last(nearer_m):
    """Beams that end behind its old place show that it is not there."""
    bench = Bench()
    bench.look(something(2.0 - nearer_m, beams=41), seconds=3.0)
    bench.look(something(2.0, beams=41), seconds=0.5)
    bench.look(hall(), pose=Pose(0.0, 0.0, math.pi))
    away_m = np.hypot(*bench.memory.as_seen(bench.trail, bench.now_s).T)
    assert not (np.abs(away_m - (2.0 - nearer_m)) < 0.005).any()
    assert (np.abs(away_m - 2.0) < 0.005).any()


def test_a_thin_leg_close_to_a_wall_is_not_forgotten():
    bench = Bench()
    ranges = something(2.0, beams=81)
    ranges[284:287] = 1.93
    bench.look(ranges, seconds=6.0)
    bench.look(hall(), pose=Pose(0.0, 0.0, math.pi))
    away_m = np.hypot(*bench.memory.as_seen(bench.trail, bench.now_s).T)
    assert away_m.min() == pytest.approx(1.93, abs=0.01)


def test_a_beam_that_stands_alone_is_not_remembered():
    bench = Bench()
    bench.look(something(2.0, beams=1))
    bench.look(hall(), pose=Pose(0.0, 0.0, math.pi))
    assert len(bench.remembered) == 0


def test_points_inside_the_hull_are_not_given():
    bench = Bench()
    bench.look(something(1.0, 90.0), seconds=1.0)
    bench.look(hall(), pose=Pose(0.0, 0.4, math.radians(-30)))
    assert len(bench.remembered) > 0
    bench.look(hall(), pose=Pose(0.0, 0.8, math.radians(-30)))
    assert len(bench.remembered) == 0
    bench.look(hall(), pose=Pose(0.0, 0.4, math.radians(-30)))
    assert len(bench.remembered) > 0, "the odometry may have been wrong about it"


def test_places_stay_the_same_until_a_scan_teaches_something():
    bench = Bench()
    bench.look(something())
    bench.look(hall(), pose=TURNED_AWAY)
    before = bench.memory.places(bench.trail, bench.now_s)
    assert len(before) and bench.memory.places(bench.trail, bench.now_s) is before
    bench.look(hall(), pose=TURNED_AWAY)
    assert bench.memory.places(bench.trail, bench.now_s) is not before


@pytest.mark.parametrize("set_back_s", [-0.02, 60.0])
def test_in_another_frame_nothing_is_known(set_back_s):
    bench = Bench()
    bench.look(something(1.0, 90.0), seconds=1.0)
    bench.look(hall(), pose=Pose(0.0, 0.0, math.radians(-30)))
    assert len(bench.remembered) > 0
    there = Pose(1.0, 0.0, math.radians(-30))
    bench.trail.forget()
    bench.trail.add(bench.now_s - set_back_s, there, STILL)
    bench.now_s -= max(set_back_s, 0.0)
    assert len(bench.remembered) == 0
    bench.look(hall(), pose=there)
    assert len(bench.remembered) == 0


def test_a_scan_that_matches_no_odometry_teaches_nothing():
    bench = Bench()
    bench.laser.observe(scanned(100.1, something()))
    bench.memory.learn(bench.trail, 100.1)
    assert len(bench.remembered) == 0


# --- simulated driving ----------------------------------------------------------------------------

SEEDS = [1]  # script/bench gate-world uses many seeds


def half_blind_tiago():
    """A TIAGo that reverses fast, without sonars: it detects nothing behind it, and has only its memory."""
    return tiago_profile(
        limits=Limits(1.0, 0.6, 0.0, 2.0944, 1.0, 2.0944), sonar_poses={}, sonar_fov={}, blind_mps=0.6
    )


def without_memory(world):
    for memory in world.gate._memories.values():
        memory.learn = lambda trail, now_s: None
    return world


def past_a_leg_and_back(world):
    """Pass a leg until it is out of view, then reverse in a bend over it. Returns the verdicts."""
    world.drive(Velocity(0.5, 0.0, 0.0), 3.6)
    world.drive(STILL, 1.0)
    return [world.drive(Velocity(-0.5, 0.0, -0.5), 0.05) for _ in range(80)]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("x", [0.85, 0.95, 1.1])
def test_a_leg_that_passed_out_of_view_is_not_hit_in_reverse(x, seed):
    world = World(half_blind_tiago(), leg(x, 0.40), seed)
    verdicts = past_a_leg_and_back(world)
    assert world.least_gap_m > 0.0
    held = [verdict for verdict in verdicts if verdict.code == "obstacle"]
    assert held and all("laser, remembered" in verdict.text for verdict in held)


def test_without_memory_the_same_leg_is_hit():
    world = without_memory(World(half_blind_tiago(), leg(0.9, 0.40)))
    past_a_leg_and_back(world)
    assert world.least_gap_m < 0.0


def turn_beside_a_leg(world):
    world.drive(Velocity(0.5, 0.0, 0.0), 1.7)
    world.drive(STILL, 1.0)
    return world.drive(Velocity(0.0, 0.0, -1.0), 3.0)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_corner_does_not_turn_into_a_leg_that_is_out_of_view(seed):
    """The rear corner of a long box sweeps over the space next to it, outside the laser's field of view."""
    world = World(box_profile(), leg(0.4, 0.32), seed)
    verdict = turn_beside_a_leg(world)
    assert world.least_gap_m > 0.0
    assert verdict.code == "obstacle" and "laser, remembered" in verdict.text


def test_without_memory_the_corner_does_hit_it():
    world = without_memory(World(box_profile(), leg(0.4, 0.32)))
    turn_beside_a_leg(world)
    assert world.least_gap_m < 0.0


def through_a_door(world):
    """Time (s) to pass the door."""
    while world.pose.x < 3.2 and world.steps < 1500:
        world.drive(towards(1.4 if world.pose.x < 0.9 else 4.5, 0.0, 0.5), 0.05)
    return world.now_s - 50.0


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("width", "ratio"), [(0.80, 1.01), (0.70, 1.03), (0.64, 1.15)])
def test_door_posts_that_are_remembered_cost_next_to_no_time(width, ratio, seed):
    posts = doorway(2.0, width)
    with_memory = World(tiago_profile(), posts, seed)
    without = without_memory(World(tiago_profile(), posts, seed))
    assert through_a_door(with_memory) <= ratio * through_a_door(without)
    assert with_memory.least_gap_m > 0.0


def person(x, y):
    return np.array(leg(x, y, width=0.3), dtype=float).reshape(-1, 2, 2)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_passer_by_blocks_for_the_shortest_life_only(seed):
    """A person walks close along the robot's side from front to rear, and away."""
    world = World(half_blind_tiago(), wall(6, -6, 6, 6), seed)
    nobody = world.ends
    for step in range(16):
        world.ends = np.concatenate((nobody, person(1.5 - 0.1 * step, 0.5)))
        world.drive(STILL, 0.1)
    back = Velocity(-0.3, 0.0, -0.3)
    for step in range(15):
        world.ends = np.concatenate((nobody, person(-0.1 * step, 0.5 + 0.2 * step)))
        world.drive(STILL, 0.1)
    world.ends = nobody
    assert len(world.gate._memories["/scan_raw"].places(world.gate._trail, world.now_s)), "left behind"
    world.drive(STILL, LASER_LAYER.shortest_life_s - 1.4)
    assert world.drive(back, 0.05).code == "free"


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("stick", [Velocity(0.0, 0.0, 1.0), Velocity(0.3, 0.0, 0.4)], ids=["turn", "bend"])
def test_a_robot_boxed_in_by_old_memory_gets_out(stick, seed):
    """The obstacles were removed while out of view: the gate still remembers walls on three sides."""
    ring = wall(-0.4, -0.4, 0.3, -0.4) + wall(-0.4, 0.4, 0.3, 0.4) + wall(-0.4, -0.4, -0.4, 0.4)
    world = World(half_blind_tiago(), ring, seed, half_view=math.pi * 0.999, beams=1000)
    world.drive(STILL, 4.0)
    world.half_view, world.beams, world.ends = math.radians(95), 572, person(9.0, 9.0)
    assert world.drive(Velocity(-0.5, 0.0, 0.0), 1.0).code == "obstacle", "it is boxed in"
    world.drive(stick, 6.0)
    begin = world.pose
    world.drive(Velocity(-0.5, 0.0, 0.0), 3.0)
    assert math.hypot(world.pose.x - begin.x, world.pose.y - begin.y) > 1.0


def test_scans_are_thinned_out_for_memory_until_somebody_drives(tiago):
    memory, learns = tiago.gate._memories[LASER], []

    def scan(distance_m):
        tiago.now_s += 0.1
        tiago.ahead_at(distance_m)
        tiago.odometry()
        facts = tiago.stamp_s, tiago.now_s, tiago.ranges, -math.radians(95), STEP, 0.05, 25.0
        tiago.gate.observe_scan(LaserScan(LASER, *facts), True)
        learns.append(memory._learned_s == tiago.stamp_s)

    for _ in range(4):
        scan(1.0)
        assert tiago.gate.sensor_health(tiago.now_s)[1].age_s == 0.0, "each scan shows that the laser works"
    scan(0.6)
    assert learns == [False, True, False, True, False]
    nearest_m = tiago.gate.obstacles(tiago.now_s).points[:, 0].min()
    assert nearest_m == pytest.approx(0.802, abs=0.01), "the newest scan counts before memory learns from it"
    tiago.gate.observe_new_driver()
    assert memory._learned_s == tiago.stamp_s
