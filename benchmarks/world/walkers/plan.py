"""Draw a run by a seed: robot, sensors, room, and people whose way meets the robot's.

The people do not react to the robot. They reach a place of the robot's hull when a robot that nothing slows
would be there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from benchmarks.world.walkers import plane
from benchmarks.world.walkers.gait import STEP_S, Build, Floats, Walk, moved, step_length, way
from benchmarks.world.walkers.plane import Things
from robots.shared.geometry.poses import Pose, Velocity
from robots.simulator.sensors.odometry import Drift

HULL_M = 0.27
WARM_UP_S = 0.6  # before the stick is touched
GOES_ON_S = 2.5  # after the meeting
SHOWN_S = 1.5  # before the meeting: until then a desk may hide the person
LASER = Pose(0.202, 0.0, 0.0)
ADULT = Build(shin_m=0.055, apart_m=0.09, trunk_m=0.15, step_share=1.0)
CHILD = Build(shin_m=0.04, apart_m=0.06, trunk_m=0.10, step_share=0.6)
ALONE, PAIR, A_CHILD, TROLLEY = "adult", "two people", "child", "trolley"
CROSSING, OBLIQUE, ONCOMING, OVERTAKING, FROM_BEHIND = (
    "crossing",
    "oblique",
    "oncoming",
    "overtaking",
    "from the side behind",
)
HEADINGS = {  # range of the person's heading from the robot's (degrees, to either side), and share of the runs
    CROSSING: ((65.0, 115.0), 0.42),
    OBLIQUE: ((115.0, 160.0), 0.23),
    ONCOMING: ((160.0, 180.0), 0.18),
    OVERTAKING: ((-5.0, 5.0), 0.12),
    FROM_BEHIND: ((20.0, 65.0), 0.05),
}
_GROUPS = {ALONE: 0.62, PAIR: 0.14, A_CHILD: 0.13, TROLLEY: 0.11}
ACCELERATES_MPS2 = 3.0  # of people who start, stop or turn
_ATTEMPTS = 60  # to place a desk that hides the person
_ROBOT_ROOM_M, _PERSON_ROOM_M = 0.65, 0.45  # from the ways to furniture


class LaserKind(NamedTuple):
    """A laser: field of view and step in radians, rate, noise, shares of lost and of mixed beams."""

    view: float
    step: float
    hz: float
    sigma_m: float
    lost: float
    mixed: float  # of the beams at an edge: they measure a place between near and far

    def __str__(self) -> str:
        return (
            f"laser {math.degrees(self.view):.0f} deg, {math.degrees(self.step):.2f} deg, {self.hz:.1f} Hz, "
            f"noise {1000 * self.sigma_m:.0f} mm, lost {100 * self.lost:.1f} %"
        )


class Delays(NamedTuple):
    """Delays of messages in seconds; each takes up to 10 ms longer."""

    odometry_s: float
    scan_s: float
    command_s: float


@dataclass(frozen=True)
class Plan:
    """One run."""

    kind: str
    group: str
    walks: tuple[Walk, ...]
    trolley: tuple[float, float] | None  # length and width of what the first person pushes
    things: Things  # that stand
    asked: Velocity
    meets_s: float
    speed_mps: float
    laser: LaserKind
    delays: Delays
    drift: Drift
    brake_share: float
    is_hidden: bool  # a desk hides the person until `SHOWN_S` before the meeting
    manner: str  # "hesitates", "turns", or ""

    @property
    def ends_s(self) -> float:
        """The end of the run, seconds."""
        return self.meets_s + GOES_ON_S

    def people(self, time_s: float) -> Things:
        """Return what the laser sees of the people: shins, and the trolley's sides."""
        discs = [(x, y, walk.build.shin_m) for walk in self.walks for x, y in walk.shins(time_s)]
        lines = plane.NO_LINES
        if self.trolley:
            length_m, width_m = self.trolley
            x, y, yaw = self.walks[0].trunk(time_s)
            ahead_m = 0.45 + length_m / 2.0
            lines = plane.box(
                x + ahead_m * math.cos(yaw), y + ahead_m * math.sin(yaw), length_m, width_m, yaw
            )
        return Things(lines, np.array(discs).reshape(-1, 3))

    def __str__(self) -> str:
        where = f"{self.kind}, {self.group}{', ' + self.manner if self.manner else ''}"
        hidden = f", hidden until {SHOWN_S} s before" if self.is_hidden else ""
        return (
            f"{where}{hidden}: {self.speed_mps:.2f} m/s; robot asked for {self.asked.vx:.2f} m/s, "
            f"{self.asked.w:.2f} rad/s, brake {self.brake_share:.2f}; {self.laser}"
        )


def drawn(seed: int, *, alone: bool = False) -> Plan:
    """Return the plan of a seed. `alone`: the same room and robot without people."""
    random = np.random.default_rng([seed, 67])
    kind = _one_of(random, {name: share for name, (_, share) in HEADINGS.items()})
    group = _one_of(random, _GROUPS)
    asked = _asked(random)
    meets_s = WARM_UP_S + float(random.uniform(2.5, 4.5))
    walks, speed_mps, manner = _walks(random, kind, group, asked, meets_s)
    trolley = (float(random.uniform(0.5, 0.9)), float(random.uniform(0.4, 0.6))) if group == TROLLEY else None
    plan = Plan(
        kind,
        group,
        walks,
        trolley,
        Things(),
        asked,
        meets_s,
        speed_mps,
        _laser(random),
        Delays(*(float(delay) for delay in random.uniform((0.005, 0.02, 0.02), (0.02, 0.06, 0.08)))),
        Drift(linear_off=float(random.uniform(-0.03, 0.03)), angular_off=float(random.uniform(-0.05, 0.05))),
        float(random.uniform(0.8, 1.1)),
        is_hidden=False,
        manner=manner,
    )
    plan = replace(plan, things=_room(random, plan))
    if random.random() < 0.4:
        plan = _hidden(random, plan)
    return replace(plan, walks=(), trolley=None) if alone else plan


def robot_way(asked: Velocity, until_s: float) -> Iterator[tuple[float, Pose]]:
    """Yield times and poses of a robot that nothing slows, every `STEP_S`; it accelerates with 1 m/s^2."""
    x = y = yaw = time_s = 0.0
    while time_s <= until_s:
        yield time_s, Pose(x, y, yaw)
        share = min(max(time_s - WARM_UP_S, 0.0) / asked.vx, 1.0)
        yaw += share * asked.w * STEP_S
        x += share * asked.vx * STEP_S * math.cos(yaw)
        y += share * asked.vx * STEP_S * math.sin(yaw)
        time_s += STEP_S


def _one_of(random: np.random.Generator, shares: dict[str, float]) -> str:
    return list(shares)[int(random.choice(len(shares), p=list(shares.values())))]


def _asked(random: np.random.Generator) -> Velocity:
    speed = 1.0 if random.random() < 0.5 else float(random.uniform(0.3, 1.0))
    turn = float(random.uniform(-0.6, 0.6)) * speed if random.random() < 0.35 else 0.0
    return Velocity(speed, 0.0, turn)


def _laser(random: np.random.Generator) -> LaserKind:
    return LaserKind(
        view=math.radians(190.0 if random.random() < 0.5 else 220.0),
        step=math.radians(0.33 if random.random() < 0.6 else float(random.uniform(0.25, 0.75))),
        hz=float(random.uniform(5.0, 15.0)),
        sigma_m=float(random.uniform(0.003, 0.015)),
        lost=float(random.uniform(0.0, 0.02)),
        mixed=float(random.uniform(0.0, 0.5)),
    )


def _walks(
    random: np.random.Generator, kind: str, group: str, asked: Velocity, meets_s: float
) -> tuple[tuple[Walk, ...], float, str]:
    """Draw the people's walks: they meet the robot's hull at `meets_s`."""
    build = CHILD if group == A_CHILD else ADULT
    speed_mps = float(random.uniform(0.6, 1.5 if group in (A_CHILD, TROLLEY) else 2.0))
    if kind in (OVERTAKING, FROM_BEHIND):
        speed_mps = max(speed_mps, min(asked.vx + float(random.uniform(0.2, 0.8)), 2.0))
    manner = _one_of(random, {"": 0.5, "hesitates": 0.25, "turns": 0.25})
    length_m = _lengths(random, speed_mps, meets_s, hesitates=manner == "hesitates")
    until_m = float(length_m[round(meets_s / STEP_S)])
    turn = 0.0
    if kind == OVERTAKING:  # passes beside the robot, then crosses its way
        slowest = math.acos(min(asked.vx / speed_mps, 1.0))
        turn = min(slowest + math.radians(float(random.uniform(10.0, 60.0))), math.radians(120.0))
    elif manner == "turns":
        turn = float(random.choice((-1.0, 1.0))) * math.radians(float(random.uniform(20.0, 90.0)))
    within_m = max(float(random.uniform(0.3, 1.0)), abs(turn) * speed_mps**2 / ACCELERATES_MPS2)
    if group == TROLLEY:  # its front swings
        turn, within_m = 0.7 * turn, within_m + 1.2
    before_m = float(random.uniform(0.3, 2.0))
    if kind == OVERTAKING:
        before_m = float(random.uniform(0.7, 1.1)) / math.sin(turn) + within_m / 2.0
    turns_at_m = max(until_m - before_m, 0.0)
    path = way(float(length_m[-1]) + 1.0, turn, turns_at_m, within_m)
    meeting = [pose for _, pose in robot_way(asked, meets_s)][-1]
    side = float(random.choice((-1.0, 1.0)))
    low, high = HEADINGS[kind][0]
    heading = meeting.yaw + side * math.radians(float(random.uniform(low, high)))
    if kind == OVERTAKING:
        path = path._replace(y=-side * path.y, heading=-side * path.heading)
        heading += float(path.at(np.array([until_m]))[2][0])
    at = HULL_M * random.uniform(-0.8, 0.8), HULL_M * random.uniform(-0.8, 0.8)
    path = moved(path, meeting.x + float(at[0]), meeting.y + float(at[1]), heading, until_m)
    if group == TROLLEY:  # the trolley meets the robot, ahead of the person
        length_m = length_m - float(random.uniform(0.0, 1.0))
    first = Walk(build, path, length_m, step_length(speed_mps, build))
    if group != PAIR:
        return (first,), speed_mps, manner
    if random.random() < 0.5:
        beside = replace(first, left_m=float(random.choice((-1.0, 1.0)) * random.uniform(0.55, 0.8)))
    else:
        beside = replace(first, ahead_m=-float(random.uniform(0.7, 1.0)))
    return (first, replace(beside, step_m=0.95 * first.step_m)), speed_mps, manner


def _lengths(random: np.random.Generator, speed_mps: float, meets_s: float, *, hesitates: bool) -> Floats:
    """Return the way's length at each moment: nearly constant speed, or slower for a while."""
    moments = np.arange(0.0, meets_s + GOES_ON_S + 1.0, STEP_S)
    phase, hz = float(random.uniform(0.0, math.tau)), float(random.uniform(0.2, 0.6))
    speed = speed_mps * (1.0 + 0.08 * np.sin(phase + math.tau * hz * moments))
    if hesitates:
        begins_s = meets_s - float(random.uniform(0.2, 2.2))
        slow, lasts_s = float(random.uniform(0.0, 0.5)), float(random.uniform(0.3, 1.5))
        after = moments - begins_s
        ramp_s = speed_mps / ACCELERATES_MPS2
        held = np.clip(np.minimum(after / ramp_s, (lasts_s + 2.0 * ramp_s - after) / ramp_s), 0.0, 1.0)
        speed *= 1.0 - (1.0 - slow) * held
    return np.concatenate(([0.0], np.cumsum(speed[:-1] * STEP_S)))


# --- what stands ----------------------------------------------------------------------------------


def _room(random: np.random.Generator, plan: Plan) -> Things:
    """Draw walls and furniture that leave both ways free."""
    far = random.uniform(7.0, 10.0, 4)
    things = Things(
        plane.box((far[0] - far[1]) / 2, (far[2] - far[3]) / 2, far[0] + far[1], far[2] + far[3], 0.0)
    )
    free = _ways(plan)
    for _ in range(int(random.integers(0, 13))):
        x, y, yaw = random.uniform((-2.0, -4.0, 0.0), (7.0, 4.0, math.tau)).tolist()
        piece = _furniture(random, x, y, yaw)
        if _leaves_free(piece, free):
            things = things.joined(piece)
    return things


def _furniture(random: np.random.Generator, x: float, y: float, yaw: float) -> Things:
    what = int(random.integers(4))
    if what == 0:
        return Things(discs=np.array([(x, y, float(random.uniform(0.05, 0.25)))]))
    if what == 1:
        length_m, width_m = random.uniform(0.3, 1.5, 2).tolist()
        return Things(plane.box(x, y, length_m, width_m, yaw))
    size, leg_m = ((1.2, 0.7), 0.025) if what == 2 else ((0.42, 0.42), 0.015)
    corners = plane.box(x, y, *size, yaw)[:, :2]
    return Things(discs=np.concatenate((corners, np.full((4, 1), leg_m)), axis=1))


def _ways(plan: Plan) -> Floats:
    """Return places (x, y, room) along the ways of robot and people."""
    robot = [(pose.x, pose.y, _ROBOT_ROOM_M) for _, pose in robot_way(plan.asked, plan.ends_s)]
    people = [
        (*walk.trunk(time_s)[:2], _PERSON_ROOM_M)
        for walk in plan.walks
        for time_s in np.arange(0.0, plan.ends_s, 0.1).tolist()
    ]
    return np.array(robot[::10] + people)


def _leaves_free(piece: Things, ways: Floats) -> bool:
    return bool((piece.distances(ways[:, :2]) > ways[:, 2]).all())


def _hidden(random: np.random.Generator, plan: Plan) -> Plan:
    """Return the plan with a desk that hides the people until `SHOWN_S` before the meeting, if one fits."""
    poses = dict(robot_way(plan.asked, plan.meets_s))
    shown_s = plan.meets_s - SHOWN_S
    times = [time_s for time_s in poses if time_s >= shown_s - 1.2][::8]
    robot = np.array([(poses[t].x + LASER.x, poses[t].y) for t in times])
    person = np.array([plan.walks[0].trunk(t)[:2] for t in times])
    since_s = np.array(times) - shown_s
    free = _ways(plan)
    at = int(np.argmin(np.abs(since_s)))
    for _ in range(_ATTEMPTS):
        corner = robot[at] + float(random.uniform(0.2, 0.9)) * (person[at] - robot[at])
        yaw = poses[times[at]].yaw + math.pi + float(random.uniform(-0.9, 0.9))
        length_m, width_m = float(random.uniform(1.2, 3.0)), float(random.uniform(0.05, 0.7))
        middle = corner + length_m / 2.0 * np.array((math.cos(yaw), math.sin(yaw)))
        desk = Things(plane.box(float(middle[0]), float(middle[1]), length_m, width_m, yaw))
        between = person - robot
        far = plane.cast(robot, np.arctan2(between[:, 1], between[:, 0]), desk).ranges
        covered = far < np.hypot(*between.T)
        hides = covered[since_s < -0.1].mean() > 0.8 and not covered[since_s > 0.15].any()
        if hides and _leaves_free(desk, free):
            return replace(plan, things=plan.things.joined(desk), is_hidden=True)
    return plan
