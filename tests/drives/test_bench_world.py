"""The gate's benchmark detects crashes and judges by the true world."""

from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.world.cases import arm, clutter, doors, drawn, leaving, objects, parked
from benchmarks.world.drivers import FullStick, Restless
from benchmarks.world.judge import is_stuck, kept
from benchmarks.world.loop import Case, Conditions, Loop, Moment, Seen, Touch, Trace
from benchmarks.world.play import at_most, loop_of
from benchmarks.world.sensors import STANDARD, Sensors
from benchmarks.world.truth import Truth
from benchmarks.world.witness import seen
from robots.bridge.arm.posture import ArmPosture
from robots.bridge.gate.arm.discs import AT_HOME
from robots.shared.geometry.poses import STILL, Velocity
from robots.simulator.faults import Faults
from robots.simulator.physics.base import Twist
from robots.simulator.physics.mujoco_world import Physics, Pose
from robots.simulator.sensors.body import TIAGO
from robots.simulator.sensors.sonar import Sonar
from robots.simulator.worlds import Box, Chair, Table, World

ORIGIN = Pose(0.0, 0.0, 0.0)
AHEAD = Velocity(1.0, 0.0, 0.0)


def played(controller: str, thing: str, angle: int, share: float = 1.0, seed: int = 0) -> Trace:
    case = objects.build(objects.ObjectJob(controller, thing, angle, share, seed))
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


def test_the_gate_stops_before_a_wall_with_a_zero_twist():
    trace = played("gate", "wall", 0)
    assert not trace.touches
    assert trace.moments[-1].sent.vx == 0.0
    assert trace.moments[-1].gap_m < 0.2


def test_the_same_seed_gives_the_same_run():
    first, again = (played("gate", "table leg", 45, 0.5, seed=3) for _ in range(2))
    assert first.moments == again.moments


def test_a_driver_passes_the_narrowest_door_without_help():
    trace = loop_of(doors.build(0.64, 1), "none", 1).play()
    assert trace.arrived
    assert not trace.touches


def test_the_true_way_is_free_up_to_its_obstacle():
    truth = Truth(box_at(1.5, 0.0))
    assert truth.free_m(ORIGIN, AHEAD, 3.0) == pytest.approx(1.4 - 0.27 - 0.05, abs=0.05)
    assert truth.free_m(ORIGIN, Velocity(-0.2, 0.0, 0.0), 3.0) == 3.0
    assert truth.free_m(Pose(0.0, 0.0, math.pi), Velocity(-0.2, 0.0, 0.0), 3.0) < 1.2


def test_an_arc_meets_a_box_that_a_line_passes():
    truth = Truth(box_at(1.0, 1.0))
    assert truth.free_m(ORIGIN, AHEAD, 3.0) == 3.0
    assert truth.free_m(ORIGIN, Velocity(1.0, 0.0, 1.0), 3.0) < 1.4


def test_reverse_has_its_own_limit_and_names_causes():
    limits = loop_of(objects.build(objects.ObjectJob("none", "wall", 0, 1.0, 0)), "none", 0).limits
    text = "stopped (0.2 m/s asked): sonar, remembered, 0.1 m behind"
    asked = Velocity(-0.2, 0.0, 0.0)

    def in_the_open(sent_mps):
        sent = Velocity(sent_mps, 0.0, 0.0)
        said = [
            Moment(0.05 * n, ORIGIN, Twist(), asked if n else STILL, sent, "", text, 1.0, True)
            for n in range(41)
        ]
        return kept(Trace(said), Truth(box_at(4.0, 0.0)), limits)

    assert in_the_open(-0.1).lost_back_percent == pytest.approx(0.0)
    held = in_the_open(0.0)
    assert held.lost_back_percent == 100.0
    assert held.wide == held.back > 0
    assert dict(held.stopped_by) == {"reverse: sonar, remembered": held.false_stops}


def test_obstacles_above_the_robot_are_ignored():
    assert Truth(box_at(1.0, 0.0, z=1.3)).free_m(ORIGIN, AHEAD, 3.0) == 3.0


def moments(sent_mps: float, asked: Velocity = AHEAD) -> Trace:
    """A trace of 2 s of full stick at the origin, in which twists of `sent_mps` were published."""
    sent = Velocity(sent_mps, 0.0, 0.0)
    return Trace(
        [Moment(0.05 * n, ORIGIN, Twist(), asked if n else STILL, sent, "", "", 1.0, True) for n in range(41)]
    )


def test_standing_in_the_open_is_a_false_stop():
    limits = loop_of(objects.build(objects.ObjectJob("none", "wall", 0, 1.0, 0)), "none", 0).limits
    in_the_open = kept(moments(0.0), Truth(box_at(4.0, 0.0)), limits)
    assert in_the_open.false_stops == in_the_open.free > 0
    assert in_the_open.lost_percent == 100.0
    assert kept(moments(1.0), Truth(box_at(4.0, 0.0)), limits).lost_percent == pytest.approx(0.0)
    assert kept(moments(0.0), Truth(box_at(0.6, 0.0)), limits).free == 0


def test_reverse_is_judged_by_the_stick_and_by_its_limit():
    limits = loop_of(objects.build(objects.ObjectJob("none", "wall", 0, 1.0, 0)), "none", 0).limits
    behind, back = Truth(box_at(-4.0, 0.0)), Velocity(-1.0, 0.0, 0.0)
    all_given, half = (kept(moments(mps, back), behind, limits) for mps in (-0.1, -0.05))
    assert all_given.lost_back_percent == pytest.approx(0.0)
    assert half.lost_back_percent == pytest.approx(50.0)
    assert half.lost_percent > all_given.lost_percent > 50.0


def test_every_case_leaves_room_where_it_begins():
    for job in objects.cases("none", 1):
        case: Case = objects.build(job)
        assert Physics(case.world, TIAGO, ORIGIN).clearance_m() >= objects.NEAREST_M, job


def test_bounds_are_poissons():
    assert at_most(0) == pytest.approx(3.0, abs=0.005)
    assert at_most(1) == pytest.approx(4.744, abs=0.005)


# --- obstacles visible to sensors ----------------------------------------------------------------


def touched(
    world: World, other: str, *, reverse: bool = True, faults: Faults | None = None
) -> tuple[Loop, Touch]:
    """Drive without a gate until the robot touches `other`."""
    x = -1.0 if reverse else 1.0
    wrong = ((0.0, faults),) if faults else ()
    case = Case(world, ORIGIN, lambda _: FullStick(x, 0.0, 1.0), 15.0, conditions=Conditions(faults=wrong))
    loop = loop_of(case, "none", 1)
    loop.controller.looks = True
    touch = loop.play().touches[0]
    assert touch.other == other
    return loop, touch


def world_of(**things) -> World:
    return World(name="w", size=(-9.0, -9.0, 9.0, 9.0), **things)


def leg_at(x: float, y: float) -> Box:
    return Box(name="leg", at=(x, y), size=(0.04, 0.04, 0.7))


def test_a_sonar_has_heard_a_leg_behind_the_robot():
    known = seen(*touched(world_of(boxes=[leg_at(-0.8, 0.0)]), "leg"))
    assert known is not None
    assert known.sensors == ("base_sonar_02_link",)
    assert known.before_s > 1.0


def test_a_leg_between_two_sonars_is_heard_too_late():
    known = seen(*touched(world_of(boxes=[leg_at(-0.7, 0.24)]), "leg"))
    assert known is not None
    assert not known.in_time


def test_a_table_top_behind_the_robot_is_unseen():
    desk = Table(name="desk", at=(-0.9, 0.0), size=(0.7, 1.4), legs=False)
    assert seen(*touched(world_of(tables=[desk]), "desk top")) is None


def test_the_camera_saw_a_table_top_unless_it_was_dead():
    desk = world_of(tables=[Table(name="desk", at=(2.5, 0.0), size=(0.7, 1.4), legs=False)])
    known = seen(*touched(desk, "desk top", reverse=False))
    assert known is not None
    assert known.sensors == ("depth",)
    assert seen(*touched(desk, "desk top", reverse=False, faults=Faults(depth_dead=True))) is None


def test_the_legs_of_a_chair_imply_its_seat():
    known = seen(
        *touched(world_of(chairs=[Chair(name="chair", at=(2.0, 0.0))]), "chair leg 2", reverse=False)
    )
    assert known is not None
    assert "laser" in known.sensors


def test_a_dead_laser_has_seen_nothing():
    leg = world_of(boxes=[leg_at(2.0, 0.0)])
    known = seen(*touched(leg, "leg", reverse=False, faults=Faults(laser_dead=True)))
    assert known is not None
    assert known.sensors == ("depth",)


# --- drawings ------------------------------------------------------------------------------------


def test_drawn_runs_have_each_object_way_and_start():
    jobs = [drawn.job_of(seed) for seed in range(80)]
    assert len({(job.thing, job.angle, job.cold) for job in jobs}) == 80


def test_draws_stay_in_bounds_and_repeat_by_seed():
    for seed in range(200):
        conditions = drawn.conditions_of(seed)
        assert conditions == drawn.conditions_of(seed)
        sensors, faults = conditions.sensors, conditions.faults[0][1]
        assert math.radians(15) <= sensors.sonar_fov <= math.radians(60)
        assert 0.01 <= sensors.sonar_sigma_m <= 0.05
        assert 5.0 <= sensors.laser_hz <= 25.0
        assert math.radians(180) <= 2 * sensors.laser_half <= math.radians(270)
        assert 5.0 <= sensors.depth_hz <= 30.0
        assert 0.0 <= conditions.late_s <= 0.4
        assert 0.6 <= faults.brake_share <= 1.2
        assert abs(conditions.drift.linear_off) <= 0.05


def test_sensors_measure_as_often_and_as_coarsely_as_drawn():
    sensors = Sensors(
        sonar_fov=1.0, laser_hz=20.0, laser_step=math.radians(1.0), depth_size=(80, 60), depth_hz=30.0
    )
    case = Case(
        world_of(),
        ORIGIN,
        lambda _: FullStick(0.0, 0.0, 1.0),
        4.0,
        9.0,
        conditions=Conditions(sensors=sensors),
    )
    loop = loop_of(case, "gate", 0)
    scans, pictures = [], []
    loop.controller.scan = lambda stamp_s, at_s, ranges: scans.append(len(ranges))
    loop.controller.depth = lambda stamp_s, at_s, metres, to_base: pictures.append(metres.shape)
    loop.play()
    assert len(scans) == pytest.approx(80, abs=3)
    assert set(scans) == {221}
    assert len(pictures) == pytest.approx(120, abs=6)
    assert set(pictures) == {(60, 80)}
    assert loop.robot.sonars[0].mount.fov == 1.0
    assert set(loop.controller.gate.profile.sonar_fov.values()) == {1.0}


@pytest.mark.parametrize(
    ("height_m", "at_m", "echo_m"), [(0.1, 0.4, 0.46), (0.1, 0.65, 0.69), (None, 0.0, 1.0)]
)
def test_a_wide_sonar_hears_low_things_but_not_the_floor(height_m, at_m, echo_m):
    rear = Sensors(sonar_fov=math.radians(60), sonar_sigma_m=0.0).body().sonars[1]
    rear_m = rear.pose[0] - at_m - 0.1
    world = box_at(rear_m, 0.0, (0.2, 2.0, height_m)) if height_m else box_at(5.0, 5.0)
    heard_m = Sonar(rear, np.random.default_rng(0)).range_m(world)
    assert heard_m == pytest.approx(echo_m, abs=0.1)


def test_a_parked_robot_stands_until_the_stick_is_pushed():
    case = objects.build(objects.ObjectJob("none", "person", 180, 1.0, 3, cold=True))
    assert case.start == ORIGIN
    trace = loop_of(case, "none", 3).play()
    assert all(moment.sent.vx <= 0.0 and moment.sent.w == 0.0 for moment in trace.moments)
    assert trace.touches[0].other.startswith("person")


def test_the_standard_sensors_are_a_tiagos():
    assert STANDARD.body() is TIAGO
    assert (
        len(
            loop_of(Case(world_of(), ORIGIN, lambda _: FullStick(0, 0, 1), 1.0), "none", 0).robot.laser.angles
        )
        == 666
    )


@pytest.mark.parametrize(("masks", "held_s"), [(True, 0.2), (False, arm.TRIES_S)])
def test_an_arm_that_the_gate_does_not_know_holds_the_robot(monkeypatch, masks, held_s):
    if not masks:
        monkeypatch.setattr(ArmPosture, "posture", lambda self, now_s: AT_HOME)
    end = arm.play(6)  # seed 6: the robot's description lacks the gripper
    assert end.held_s == pytest.approx(held_s, abs=0.1)
    assert (end.refused_s > 0.0) is not masks


# --- robots stuck and freed ----------------------------------------------------------------------


def held(asked: Velocity, pose: Pose = ORIGIN, moving: Twist = Twist(), sent: Velocity = STILL) -> Moment:  # noqa: B008
    return Moment(1.0, pose, moving, asked, sent, "obstacle", "", 0.1, True)


def test_a_robot_held_despite_a_free_way_or_turn_is_stuck():
    limits = loop_of(Case(world_of(), ORIGIN, lambda _: FullStick(0, 0, 1), 1.0), "none", 0).limits
    truth = Truth(box_at(0.42, 0.0))  # 5 cm in front of the hull
    back, turn = Velocity(-0.2, 0.0, 0.0), Velocity(0.0, 0.0, 1.0)
    assert is_stuck(held(back), truth, limits)
    assert is_stuck(held(turn), truth, limits)
    assert not is_stuck(held(AHEAD), truth, limits)
    assert not is_stuck(held(back, moving=Twist(-0.1, 0.0, 0.0)), truth, limits)
    assert not is_stuck(held(back, sent=back), truth, limits)


def test_a_way_back_out_of_a_narrow_place_is_free():
    truth = Truth(box_at(0.0, 0.40))  # 3 cm next to the hull
    assert truth.free_m(ORIGIN, AHEAD, 2.0) == 0.0
    assert truth.free_m(ORIGIN, AHEAD, 2.0, from_near=True) == 2.0
    assert truth.free_m(Pose(-0.5, 0.0, 0.0), AHEAD, 2.0, from_near=True) < 0.6


def leaves(gaps_m: list[float], sent_mps: list[float]) -> leaving.Outcome:
    """One decision per second; the obstacle leaves from second 2 on."""
    found = [
        Moment(float(n), ORIGIN, Twist(), AHEAD, Velocity(mps, 0.0, 0.0), "", "why", gap_m, True)
        for n, (gap_m, mps) in enumerate(zip(gaps_m, sent_mps, strict=True))
    ]
    return leaving.until_again(Trace(found), 2.0)


def test_seconds_count_from_when_the_way_is_free_until_it_drives():
    assert leaves([1.0, 0.1, 0.1, 0.6, 0.8, 1.0], [1.0, 0.0, 0.0, 0.0, 0.0, 0.4]).again_s == 2.0
    assert leaves([0.1, 0.1, 0.6, 0.6], [0.0, 0.0, 0.4, 1.0]).again_s == 0.0
    assert leaves([0.1, 0.1, 0.6, 0.6], [0.0, 0.0, 0.0, 0.0]) == leaving.Outcome(math.inf, "why")
    assert leaves([1.0, 0.6, 0.6, 0.6], [1.0, 1.0, 1.0, 1.0]).again_s is None  # nothing held the robot


def test_a_chair_is_pulled_away():
    case = leaving.build("chair pulled away ahead", 1)
    loop = loop_of(case, "none", 1)
    physics = loop.robot.physics
    before_m = physics.clearance_m()
    physics.place_furniture("chair", 6.0, 6.0)
    physics.step(Twist(), 1)
    assert before_m < 2.5
    assert physics.clearance_m() == 3.0
    assert physics.cast(np.array([0.0, 0.0, 0.2]), np.array([[1.0, 0.0, 0.0]])) == [-1.0]


def test_the_head_turns_away_before_a_chair_leaves():
    kind = "chair pulled away, head aside"
    case = leaving.build(kind, 0)
    glance = case.glance
    assert glance.aside_s < case.leaving.since_s < glance.ahead_s < case.longest_s
    loop = loop_of(case, "gate", 0)
    loop.play()
    pans = {round(look.time_s, 1): look.reading for look in loop.looks if look.sensor == "depth"}
    aside = [pan for at_s, pan in pans.items() if glance.aside_s + 3.0 < at_s < glance.ahead_s]
    assert aside == [glance.pan] * len(aside) != []
    assert all(abs(pan) < 0.31 for at_s, pan in pans.items() if at_s > glance.ahead_s + 1.6)
    turning = [at_s for at_s in pans if glance.ahead_s + 0.1 < at_s < glance.ahead_s + 1.4]
    assert not turning  # the bridge ignores pictures from a fast turning head


def test_random_stick_drives_both_ways_and_half_begins_cold():
    random = Restless(np.random.default_rng(1), looks=False)
    sticks = [random.hold(Seen(0.05 * n, ORIGIN)) for n in range(40_000)]
    # The gate limits reverse to a tenth of the robot's speed: 53 % of the ten kilometres in docs/figures.md are
    # in reverse.
    back = sum(min(max(-stick.x * stick.share, 0.0), 0.1) for stick in sticks)
    ahead = sum(max(stick.x * stick.share, 0.0) for stick in sticks)
    assert 0.7 < back / ahead < 1.4
    parked, looking = (clutter.build(seed).driver(np.random.default_rng(1)) for seed in (1, 0))
    assert looking.hold(Seen(1.0, ORIGIN)).trying is False
    assert parked.hold(Seen(1.0, ORIGIN)).trying is True


def test_a_door_uses_the_given_or_the_drawn_pictures():
    assert doors.build(0.7, 3, (96, 72)).conditions.sensors == Sensors(depth_size=(96, 72), depth_hz=30.0)
    assert doors.build(0.7, 3, drawn=True).conditions == drawn.conditions_of(3)


def test_a_robot_parked_close_turns_and_drives_off():
    trace = loop_of(parked.build("wall", 1), "none", 1).play()
    assert abs(trace.moments[0].gap_m) <= 0.11
    assert trace.touches[0].other == "wall"
    assert trace.touches[0].robot.vx > 0.0
