"""The roll-out, compared with a fine simulation of the same motion."""

from __future__ import annotations

import math
from collections import Counter
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.bridge.gate.motion import braking
from robots.bridge.gate.motion.rollout import (
    CLEAR,
    MOVER_MARGIN_M,
    RESTS_S,
    SHARES,
    Commands,
    Sent,
    safe_share,
    stepped_up,
)
from robots.shared.configuration.gate_profile import Limits
from robots.shared.geometry.footprint import Polygon, footprint_of
from robots.shared.geometry.planar import Drift
from robots.shared.geometry.poses import STILL, Velocity
from tests.gate import strategies
from tests.gate.conftest import LASER, Feeder, box_profile, tiago_profile

HOLONOMIC = Limits(1.0, 1.0, 0.8, 2.0, 1.0, 2.0)
PROFILES = {
    "disc": tiago_profile(),
    "holonomic disc": tiago_profile(limits=HOLONOMIC),
    "discs": tiago_profile(discs=((-0.15, 0.0, 0.25), (0.2, 0.0, 0.22), (0.45, 0.1, 0.08))),
    "box": box_profile(),
}
PERIOD_S = 0.05
LATENCY_S = 0.20
HARD_M = 0.01
kinds = st.sampled_from(sorted(PROFILES))
clouds = strategies.clouds(reach_m=1.4)
twists = strategies.twists(decimals=2)
queues = st.lists(twists, max_size=6).map(
    lambda several: [Sent(one, (len(several) - n) * 0.05) for n, one in enumerate(several)]
)


def drifting(velocities, radius_m=0.0, grows_mps=0.0):
    """Points that move, as discs that grow."""
    velocities = np.asarray(velocities, dtype=float).reshape(-1, 2)
    count = len(velocities)
    return Drift(velocities, np.full(count, radius_m), np.full(count, grows_mps))


def roll(kind, candidate, points, queue=(), velocity=STILL, drift=None):
    profile = PROFILES[kind]
    points = np.asarray(points, dtype=float).reshape(-1, 2)
    drift = None if drift is None else drifting(drift)
    return safe_share(
        candidate, queue, velocity, points, drift, footprint_of(profile), profile, PERIOD_S, LATENCY_S
    )


def played(profile, candidate, queue, velocity, step_s=0.002):
    """Yield time, pose, and whether the queue still decides the command, every 2 ms."""
    linear, angular = braking.deceleration(profile)
    limits = profile.limits
    rates = ((limits.linear_mps2, linear), (limits.linear_mps2, linear), (limits.angular_radps2, angular))
    x = y = yaw = time_s = 0.0
    speeds = list(velocity)
    while time_s < LATENCY_S + PERIOD_S - 1e-9 or any(speeds):
        yield time_s, x, y, yaw, time_s < LATENCY_S - 1e-9
        if time_s < LATENCY_S - 1e-9:
            due = [sent.velocity for sent in queue if sent.age_s + time_s >= LATENCY_S - 1e-9]
            command = due[-1] if due else velocity
        elif time_s < LATENCY_S + PERIOD_S - 1e-9:
            command = candidate
        else:
            command = STILL
        for axis, (up, down) in enumerate(rates):
            now, wanted = speeds[axis], command[axis]
            most = step_s * (up if now * wanted >= 0 and abs(wanted) > abs(now) else down)
            speeds[axis] = now + min(max(wanted - now, -most), most)
        yaw += speeds[2] * step_s
        x += step_s * (speeds[0] * math.cos(yaw) - speeds[1] * math.sin(yaw))
        y += step_s * (speeds[0] * math.sin(yaw) + speeds[1] * math.cos(yaw))
        time_s += step_s
    yield time_s, x, y, yaw, False


def least_gaps(kind, candidate, points, queue, velocity, drift=None):
    """The least gap of each point in the simulation; moving points (`drift`) also count at the end of the rest."""
    profile = PROFILES[kind]
    hull = footprint_of(profile)
    moments = np.array([moment[:4] for moment in played(profile, candidate, queue, velocity)])
    if drift is None:
        drift = np.zeros_like(points)
    else:
        moments = np.vstack((moments, np.add(moments[-1], (RESTS_S, 0.0, 0.0, 0.0))))
    time_s, x, y, yaw = moments.T[:, :, None]
    east, north = points.T[:, None] + time_s * drift.T[:, None] - (x, y)
    local = np.cos(yaw) * east + np.sin(yaw) * north, np.cos(yaw) * north - np.sin(yaw) * east
    gaps = hull.gaps(np.asfortranarray(np.stack([axis.ravel() for axis in local], axis=1)))
    return gaps.reshape(len(moments), -1).min(axis=0, initial=np.inf)


@given(kinds, twists, queues, twists, clouds)
def test_allowed_twists_stop_clear_or_no_nearer(kind, candidate, queue, now, points):
    share = roll(kind, candidate, points, queue, now).share
    allowed = Velocity(*(share * axis for axis in candidate))
    stopping = least_gaps(kind, STILL, points, queue, now)
    going = least_gaps(kind, allowed, points, queue, now)
    # Half of the gap is enough: a hull may turn a corner out. Simulation and roll-out have different steps.
    must = np.minimum(HARD_M, max(0.0, 0.5 * stopping.min()))
    between_poses_m = 0.004 if "disc" in kind else 0.014
    assert (going >= np.minimum(must, stopping) - between_poses_m).all()


@given(kinds, twists, queues, twists, clouds)
def test_a_clear_twist_is_not_reduced(kind, candidate, queue, now, points):
    going = least_gaps(kind, candidate, points, queue, now)
    rolled = roll(kind, candidate, points[going > HARD_M + 0.012], queue, now)
    assert rolled == CLEAR


@pytest.mark.parametrize("kind", sorted(PROFILES))
def test_what_is_left_out_as_too_far_changes_no_answer(kind):
    """Compare the roll-out with near points only and the roll-out with all points."""
    random, found = np.random.default_rng(15), Counter()

    def any_twist(share=1.0):
        sideways = random.uniform(-0.5, 0.5) if kind == "holonomic disc" else 0.0
        return Velocity(
            share * random.uniform(-1.0, 1.0), share * sideways, share * random.uniform(-2.0, 2.0)
        )

    for _ in range(500):
        share = random.choice([0.1, 0.4, 1.0])
        queue = [Sent(any_twist(share), age_s) for age_s in (0.3, 0.15, 0.1, 0.02)]
        points = np.asfortranarray(random.uniform(-1.5, 1.5, (random.integers(1, 8), 2)))
        arguments = kind, any_twist(share), points, queue, any_twist(share)
        quick = roll(*arguments)
        with patch("robots.bridge.gate.motion.rollout._near", lambda points, *_: np.arange(len(points))):
            assert roll(*arguments) == quick
        found[quick.share] += 1
    assert found[1.0] > 60 and len(found) > 3, found


class Watched(Polygon):
    """A box that stores the arguments of its calls, and reports all points as near."""

    def gaps_about(self, there, spread, points, near_m):
        self.there, self.spread = there, spread
        return np.full(len(points), -1.0)

    def least_gaps(self, path, points, drift=None):
        self.paths = [*getattr(self, "paths", []), path]
        return super().least_gaps(path, points, drift)


@pytest.mark.parametrize("seed", range(3))
def test_the_whole_play_lies_within_the_spread_that_is_looked_at(seed):
    random, profile = np.random.default_rng(seed), box_profile(limits=HOLONOMIC)
    for _ in range(50):
        lies_within_its_spread(random, profile)


def lies_within_its_spread(random, profile):
    hull = Watched(profile.outline)

    def any_twist():
        return Velocity(*random.uniform(-1.0, 1.0, 2) * random.choice([0.0, 1.0]), random.uniform(-2.0, 2.0))

    queue = [Sent(any_twist(), age_s) for age_s in (0.3, 0.15, 0.05)]
    point = np.array([[3.0, 3.0]])
    safe_share(any_twist(), queue, any_twist(), point, None, hull, profile, PERIOD_S, LATENCY_S)
    path, there, spread = hull.paths[0], hull.there, hull.spread
    if max(spread.turned_left, spread.turned_right) > math.pi / 2.0:
        spread = spread._replace(turned_left=math.inf, turned_right=math.inf)
    dx, dy, turned = path.x - there.x, path.y - there.y, path.yaw - there.yaw
    along = math.cos(there.yaw) * dx + math.sin(there.yaw) * dy
    aside = math.cos(there.yaw) * dy - math.sin(there.yaw) * dx
    for off, (forth, back) in zip((along, aside, turned), (spread[:2], spread[2:4], spread[4:]), strict=True):
        assert off.max() <= forth + 1e-9
        assert off.min() >= -back - 1e-9


@given(kinds, twists, queues, twists, clouds, clouds)
def test_moving_points_are_met_at_their_future_place(kind, candidate, queue, now, points, drifts):
    several = min(len(points), len(drifts))
    points, drift = points[:several], drifts[:several]
    going = least_gaps(kind, candidate, points, queue, now, drift)
    far = going > MOVER_MARGIN_M + 0.06  # drift between two poses
    assert roll(kind, candidate, points[far], queue, now, drift[far]) == CLEAR
    stopping = least_gaps(kind, STILL, points, queue, now, drift)
    hit = (going < -0.02) & (stopping > MOVER_MARGIN_M + 0.06)
    turns_a_disc = "disc" in kind and kind != "discs" and not candidate.vx and not any(map(any, (now,)))
    if hit.any() and not turns_a_disc:
        assert roll(kind, candidate, points, queue, now, drift).share < 1.0


@given(kinds, twists, queues, twists, clouds)
def test_points_that_drift_at_no_speed_stand(kind, candidate, queue, now, points):
    still = np.zeros_like(points)
    assert roll(kind, candidate, points, queue, now, still) == roll(kind, candidate, points, queue, now)


def wall_at(distance_m):
    return [(distance_m, y) for y in np.linspace(-1.0, 1.0, 80)]


@pytest.mark.parametrize("kind", sorted(PROFILES))
@pytest.mark.parametrize("stick", [(0.8, 0.0, 0.0), (-0.5, 0.0, 0.0), (0.4, 0.0, 1.5), (0.0, 0.0, -2.0)])
def test_the_quick_check_never_clears_a_forbidden_twist(kind, stick):
    going = Velocity(*stick)
    queue = [Sent(going, 0.3), Sent(going, 0.1)]
    for distance_m in np.arange(0.28, 0.9, 0.04):
        for bearing in np.linspace(-math.pi, math.pi, 12):
            post = [(distance_m * math.cos(bearing), distance_m * math.sin(bearing))]
            rolled = roll(kind, going, post, queue, going)
            with patch("robots.bridge.gate.motion.rollout._near", return_value=np.arange(1)):
                assert roll(kind, going, post, queue, going) == rolled


def test_commands_on_their_way_count():
    """At standstill 5 cm before a wall a small step is allowed, unless earlier commands are on the way."""
    nudge = Velocity(0.1, 0.0, 0.0)
    assert roll("disc", nudge, wall_at(0.27 + 0.05)) == CLEAR
    on_their_way = [Sent(Velocity(0.5, 0.0, 0.0), age_s) for age_s in (0.20, 0.15, 0.10, 0.05)]
    assert roll("disc", nudge, wall_at(0.27 + 0.05), on_their_way).share == 0.0


def test_an_old_command_that_was_overtaken_does_not_count():
    overtaken = [Sent(Velocity(1.0, 0.0, 0.0), 5.0), Sent(STILL, 0.3)]
    assert roll("disc", Velocity(0.1, 0.0, 0.0), wall_at(0.27 + 0.06), overtaken) == CLEAR


def test_a_late_turn_bends_the_arc_into_an_obstacle():
    """At 1 m/s the base cannot turn at once, so it would hit the obstacle that it steers around."""
    fast, post = Velocity(1.0, 0.0, 0.0), [(0.95, 0.0)]
    rushing = [Sent(fast, 0.20), Sent(fast, 0.05)]
    evading = roll("disc", Velocity(1.0, 0.0, 1.0), post, rushing, fast)
    assert evading.share < 1.0 and evading.row == 0


@pytest.mark.parametrize(("room_m", "share"), [(0.37, 1.0), (0.34, 0.85), (0.31, 0.7), (0.28, 0.0)])
def test_the_largest_clear_share_is_taken(room_m, share):
    """At 0.5 m/s, share 1 of 0.6 m/s needs 0.358 m, 0.85 needs 0.325 m, braking now needs 0.292 m.

    A share of 0.7 brakes as hard as braking now.
    """
    half = Velocity(0.5, 0.0, 0.0)
    wall = wall_at(0.27 + HARD_M + room_m)
    rolled = roll("disc", Velocity(0.6, 0.0, 0.0), wall, [Sent(half, LATENCY_S)], half)
    assert rolled.share == share
    assert share in SHARES


def test_the_row_names_the_blocking_point():
    ways = [(-0.5, 0.0), (0.9, 0.9), (0.29, 0.0), (0.6, 0.5)]
    forward = Velocity(0.6, 0.0, 0.0)
    assert roll("disc", forward, ways, [Sent(forward, 0.1)]).row == 2


@given(st.floats(-math.pi, math.pi), st.floats(-0.03, 0.05), st.sampled_from([1.5, -0.7]))
def test_a_disc_always_turns_on_the_spot_and_always_retreats(bearing, gap, w):
    near = [((0.27 + gap) * math.cos(bearing), (0.27 + gap) * math.sin(bearing))]
    assert roll("disc", Velocity(0.0, 0.0, w), near) == CLEAR
    away = Velocity(math.copysign(0.2, -math.cos(bearing)), 0.0, 0.0)
    assert roll("disc", away, near) == CLEAR


@pytest.mark.parametrize("kind", sorted(PROFILES))
@pytest.mark.parametrize("gap", [-0.02, 0.0, 0.004, 0.012])
def test_every_hull_backs_off_from_a_wall_but_does_not_go_on(kind, gap):
    nose = footprint_of(PROFILES[kind]).gaps(np.array([[2.0, 0.1]]))[0]
    wall = wall_at(2.0 - nose + gap) if kind == "box" else [(2.0 - nose + gap, 0.1)]
    assert roll(kind, Velocity(-0.2, 0.0, 0.0), wall) == CLEAR
    slowly = Velocity(0.05, 0.0, 0.0)
    assert roll(kind, Velocity(0.3, 0.0, 0.0), wall, [Sent(slowly, LATENCY_S)], slowly).share < 1.0


@pytest.mark.parametrize("kind", ["disc", "box"])
def test_a_robot_drives_along_a_wall_within_its_margin(kind):
    side = 0.27 if kind == "disc" else 0.25
    wall = [(x, side + 0.006) for x in np.linspace(-1, 2, 200)]
    forward = Velocity(0.4, 0.0, 0.0)
    assert roll(kind, forward, wall, [Sent(forward, 0.2)], forward) == CLEAR


def test_a_box_that_turns_its_corner_into_a_post_is_held():
    post = [(0.0, 0.40)]
    turning = Velocity(0.0, 0.0, 1.5)
    assert roll("box", turning, post, [Sent(turning, LATENCY_S)], turning).share < 1.0
    assert roll("box", Velocity(0.0, 0.0, 0.1), post) == CLEAR


def test_a_crossing_person_passes_a_standing_one_is_passed():
    forward = Velocity(0.6, 0.0, 0.0)
    driving = [Sent(forward, 0.2), Sent(forward, 0.1)]
    beside = [(0.6, -0.9)]
    assert roll("disc", forward, beside, driving, forward) == CLEAR
    crossing = roll("disc", forward, beside, driving, forward, drift=[(0.0, 1.0)])
    assert crossing.share < 1.0 and crossing.row == 0
    leaving = roll("disc", forward, beside, driving, forward, drift=[(0.0, -1.0)])
    assert leaving == CLEAR


def test_moving_points_get_a_wider_margin_than_standing_ones():
    forward, beside = Velocity(0.6, 0.0, 0.0), [(0.5, 0.33)]
    driving = [Sent(forward, LATENCY_S)]
    assert roll("disc", forward, beside, driving, forward) == CLEAR
    assert roll("disc", forward, beside, driving, forward, drift=[(0.01, 0.0)]).share < 1.0


def test_the_places_that_somebody_may_reach_grow_with_time():
    forward, ahead = Velocity(0.6, 0.0, 0.0), np.array([(1.5, 0.0)])
    profile, hull = PROFILES["disc"], footprint_of(PROFILES["disc"])
    driving = [Sent(forward, LATENCY_S)]

    def share(radius_m, grows_mps):
        drift = drifting([(0.0, 0.0)], radius_m, grows_mps)
        return safe_share(forward, driving, forward, ahead, drift, hull, profile, PERIOD_S, LATENCY_S).share

    assert share(0.1, 0.0) == 1.0
    assert share(0.8, 0.0) < 1.0
    assert share(0.1, 0.8) < 1.0


def test_the_base_brakes_fully_if_it_cannot_stand_in_time():
    forward, ahead = Velocity(1.0, 0.0, 0.0), [(0.8, 0.0)]
    driving = [Sent(forward, LATENCY_S)]
    assert roll("disc", forward, ahead, driving, forward, drift=[(-0.5, 0.0)]).share == 0.0


@pytest.mark.parametrize("w", [0.0, 0.004, 0.5])
def test_it_brakes_fully_for_a_mover_also_while_it_turns(w):
    """A smaller turn alone is no milder braking: only zeros make the base brake as hard as it can."""
    on_arc = Velocity(0.85, 0.0, w)
    driving = [Sent(on_arc, LATENCY_S)]
    assert roll("disc", on_arc, [(0.5, -1.2)], driving, on_arc, drift=[(0.0, 1.2)]).share == 0.0


def test_it_does_not_run_on_ahead_of_somebody_who_is_faster():
    """Braking meets them, and so does driving on: later, but while the robot still moves."""
    forward = Velocity(1.0, 0.0, 0.0)
    driving = [Sent(forward, LATENCY_S)]
    assert roll("disc", forward, [(0.1, -1.4)], driving, forward, drift=[(0.6, 1.3)]).share == 0.0


def test_a_long_turn_does_not_hide_that_it_runs_on_faster():
    """Both ways end with the same turn, so both rest at the same time; driving on is faster until then."""
    now, candidate = Velocity(0.25, 0.0, 1.9), Velocity(1.0, 0.0, 1.0)
    driving = [Sent(now, LATENCY_S)]
    assert roll("disc", candidate, [(-0.93, 0.38)], driving, now, drift=[(1.25, -0.34)]).share == 0.0


def test_it_stands_a_moment_before_somebody_may_be_there():
    forward, beside = Velocity(0.6, 0.0, 0.0), [(0.45, -1.5)]
    driving = [Sent(forward, LATENCY_S)]
    assert roll("disc", forward, beside, driving, forward, drift=[(0.0, 0.6)]) == CLEAR
    assert roll("disc", forward, beside, driving, forward, drift=[(0.0, 0.85)]).share < 1.0


def test_a_robot_may_leave_a_near_moving_person():
    close = [(0.32, 0.0)]
    assert roll("disc", Velocity(-0.2, 0.0, 0.0), close, drift=[(0.0, 0.3)]) == CLEAR
    assert roll("disc", Velocity(0.0, 0.0, 1.0), close, drift=[(-1.0, 0.0)]) == CLEAR


# --- upward steps ---------------------------------------------------------------------------------

amounts = st.builds(Velocity, *(st.floats(-2.0, 2.0) for _ in range(3)))


@given(amounts, amounts, st.floats(0.001, 0.1))
def test_steps_rise_slowly_and_fall_at_once(sent, wanted, dt_s):
    profile = PROFILES["box"]
    stepped = stepped_up(sent, wanted, profile, dt_s)
    steps = (profile.limits.linear_mps2 * dt_s,) * 2 + (profile.limits.angular_radps2 * dt_s,)
    for before, goal, after, step in zip(sent, wanted, stepped, steps, strict=True):
        assert after * goal >= 0.0 and abs(after) <= abs(goal)
        assert abs(after) <= max(abs(before) if before * goal > 0 else 0.0, 0.0) + step + 1e-12
        if before * goal > 0.0 and abs(goal) <= abs(before):
            assert after == goal
        if after != goal:
            assert abs(after) == pytest.approx((abs(before) if before * goal > 0 else 0.0) + step)


def test_the_first_step_is_one_period_of_acceleration():
    stepped = stepped_up(STILL, Velocity(1.0, 0.0, -2.0), PROFILES["box"], 0.05)
    assert stepped == pytest.approx(Velocity(0.05, 0.0, -0.1))


# --- in the gate ----------------------------------------------------------------------------------


def ticks(feeder, stick, count):
    """Decisions at 20 Hz in a static world, each with the previous command."""
    verdicts, sent = [], STILL
    for _ in range(count):
        feeder.now_s += 0.05
        feeder.all()
        verdicts.append(feeder.gate.decide(stick, sent, feeder.now_s))
        sent = verdicts[-1].velocity
    return verdicts


def test_acceleration_limits_count_as_free(tiago):
    verdicts = ticks(tiago, Velocity(0.2, 0.0, 0.0), 5)
    assert [verdict.velocity.vx for verdict in verdicts] == pytest.approx([0.1, 0.15, 0.2, 0.2, 0.2])
    assert {verdict.code for verdict in verdicts} == {"free"}


def test_after_a_pause_the_first_step_is_as_short_as_ever(tiago):
    ticks(tiago, STILL, 1)
    tiago.now_s += 60.0
    tiago.all()
    assert tiago.gate.decide(Velocity(1.0, 0.0, 0.0), STILL, tiago.now_s).velocity.vx == pytest.approx(0.1)


def test_the_gate_remembers_obstacles_and_names_them():
    """A post next to the front of a robot that starts to turn: both arcs pass it, the transition does not."""
    feeder = Feeder(tiago_profile(scan_poses={LASER: (0.0, 0.0, 0.0)}))
    feeder.velocity = Velocity(0.8, 0.0, 0.0)
    feeder.ranges = np.full(571, math.inf)
    feeder.ranges[282:289] = 0.62
    feeder.all()
    fast, turning = Velocity(0.8, 0.0, 0.0), Velocity(0.1, 0.0, 2.0)
    for _ in range(3):
        feeder.now_s += 0.05
        feeder.all()
        feeder.gate.decide(fast, fast, feeder.now_s)
    with patch.object(feeder.gate.latency, "in_force_s", return_value=0.2):
        verdict = feeder.gate.decide(turning, fast, feeder.now_s)
    assert verdict.code == "obstacle"
    assert verdict.sensor == LASER and verdict.side == "ahead"
    assert verdict.text.endswith("laser, 0.3 m ahead")


def commands_of(*sent):
    commands = Commands()
    for velocity, at_s in sent:
        commands.add(velocity, at_s)
    return commands


def test_commands_are_kept_while_they_may_be_under_way():
    fast, slow = Velocity(1.0, 0.0, 0.0), Velocity(0.5, 0.0, 0.0)
    commands = commands_of((fast, 1.0), (slow, 1.1), (slow, 1.2), (STILL, 1.3))
    assert commands.lately(1.4, 0.35) == [
        Sent(fast, pytest.approx(0.4)),
        Sent(slow, pytest.approx(0.3)),
        Sent(STILL, pytest.approx(0.1)),
    ]
    assert commands.lately(1.4, 0.2) == [Sent(slow, pytest.approx(0.3)), Sent(STILL, pytest.approx(0.1))]
    assert commands.lately(1.4, 0.9)[0].velocity == fast
    commands.add(STILL, 60.0)
    assert commands.lately(60.0, 90.0) == [Sent(STILL, pytest.approx(58.7))]
