"""Robots that react late: from the first command on, or suddenly later. Full stick at a wall."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from msgspec import structs

from benchmarks.harness import Figure
from benchmarks.world.cases import objects
from benchmarks.world.controllers import GateController
from benchmarks.world.drivers import FullStick
from benchmarks.world.judge import Keeping, kept, together
from benchmarks.world.loop import Case, Conditions, Jump, Loop
from benchmarks.world.play import SCAN, loop_of, played
from benchmarks.world.robot import tiago_profile
from benchmarks.world.truth import Truth
from robots.shared.configuration.gate_profile import Parameters
from robots.simulator.physics.mujoco_world import Pose
from robots.simulator.worlds import Wall, World

FIRST_LATE_S = 0.48
FIRST_WALL_M = (0.6, 1.2)  # from the hull
JUMPS_MS = (200, 300, 400)
# Whether the delay of sensors jumps, and whether the delay of commands jumps.
WAYS = {
    "link": (True, True),
    "sensors": (True, False),
    "commands": (False, True),
}
WALL_M = (2.4, 3.2)  # from the hull
# When the delay jumps, in seconds after the robot would begin to brake (negative: before).
JUMP_WITHIN_S = (-0.4, 0.3)
HICCUP_S = (0.06, 0.10)
HICCUP_EVERY_S = 2.0  # on average
SPARE_S = Parameters().latency_spare_s
# Other values of `latency_spare_s`: a larger one costs speed, and should prevent crashes
SPARES_S = (0.2, 0.3)
SEEDS = 12  # at least, because a share needs several runs
# Share of the runs at 1 m/s that may crash, by ms: none at +200; at +300 and +400 half as many as with the
# former gate, which waited for a silence of 0.2 s. Slower runs may not crash.
MOST_SHARE = {200: 0.0, 300: 0.25, 400: 1.0 / 3.0}
STICK_S = 0.5  # from the start until the wheels begin to obey


class Late(NamedTuple):
    """One case: a way of `WAYS`, or "first"; the additional delay in ms; the share of the robot's speed."""

    way: str
    ms: int
    share: float
    seed: int
    spare_s: float = SPARE_S  # `latency_spare_s` of the profile


def jobs(repeats: int) -> list[Late]:
    """Return all cases."""
    first = [Late("first", round(1000 * FIRST_LATE_S), 1.0, seed) for seed in range(repeats)]
    jumps = [
        Late(way, ms, share, seed)
        for way in WAYS
        for ms in JUMPS_MS
        for share in objects.SHARES
        for seed in range(repeats)
    ]
    spared = [
        Late("commands", JUMPS_MS[-1], 1.0, seed, spare_s) for spare_s in SPARES_S for seed in range(repeats)
    ]
    return [*first, *jumps, *spared]


def measure(repeats: int) -> list[Figure]:
    """Return the crashes, kind by kind."""
    done = list(played("late", jobs(max(repeats, SEEDS)), play))
    figures = []
    for way, ms, share, spare_s in dict.fromkeys(_kind(job) for job, _ in done):
        crashes = [mps for job, mps in done if _kind(job) == (way, ms, share, spare_s)]
        hit = [mps for mps in crashes if mps is not None]
        name = f"first drive, {ms} ms late" if way == "first" else f"{way} later by {ms} ms, {share:g} m/s"
        name += f", {spare_s:g} s spare" if spare_s != SPARE_S else ""
        most = float(math.floor(MOST_SHARE.get(ms, 0.0) * len(crashes))) if share == 1.0 else 0.0
        figures.append(Figure(f"{name}: crashes of {len(crashes)}", len(hit), "", most))
        figures.append(Figure(f"{name}: fastest crash", max(hit, default=0.0), "m/s"))
    return [*figures, *_hiccups(max(repeats // 10, 1))]


def _hiccups(repeats: int) -> list[Figure]:
    """Measure the cost of a radio link with short gaps."""
    sums = together(kept for _, kept in played("hiccups", objects.cases("gate", repeats), play_hiccups))
    return [
        Figure("radio with gaps of 60 to 100 ms: speed lost with 2 m free", sums.lost_percent, "%"),
        Figure("radio with gaps of 60 to 100 ms: false stops", sums.false_stop_percent, "%", 1.0),
    ]


def play_hiccups(job: objects.ObjectJob) -> Keeping:
    """Play a case of `objects` with short gaps of the link."""
    random = np.random.default_rng([job.seed, job.angle])
    times = np.cumsum(random.exponential(HICCUP_EVERY_S, 30))
    hiccups = tuple(zip(times.tolist(), random.uniform(*HICCUP_S, 30).tolist(), strict=True))
    case = objects.build(job)
    conditions = replace(case.conditions, hiccups=hiccups)
    loop = loop_of(replace(case, conditions=conditions), "gate", job.seed)
    truth = Truth(loop.robot.physics)
    return kept(loop.play(), truth, loop.limits)


def _kind(late: Late) -> tuple[str, int, float, float]:
    return late.way, late.ms, late.share, late.spare_s


def play(late: Late) -> float | None:
    """Play one case. Return the speed of a crash, m/s; None: there is none."""
    profile = tiago_profile()
    parameters = structs.replace(profile.parameters, latency_spare_s=late.spare_s)
    profile = structs.replace(profile, parameters=parameters)
    trace = Loop(
        build(late), lambda fan: GateController(profile, fan), profile.limits, SCAN, late.seed
    ).play()
    return abs(trace.touches[0].robot.vx) if trace.touches else None


def build(late: Late) -> Case:
    random = np.random.default_rng([late.seed, late.ms, round(10 * late.share)])
    nearest, farthest = FIRST_WALL_M if late.way == "first" else WALL_M
    gap_m = float(random.uniform(nearest, farthest))
    case = _at_a_wall(gap_m, float(random.uniform(-0.2, 0.2)), late.share)
    if late.way == "first":
        return replace(case, conditions=Conditions(late_s=late.ms / 1000.0))
    v = late.share
    # The gate's braking distance, for a robot with a delay of 0.2 s.
    way_m = (0.2 + late.spare_s) * v + v**2 / (2.0 * 0.65) + 0.08
    brakes_s = STICK_S + v / 2.0 + (gap_m - way_m) / v
    at_s = brakes_s + float(random.uniform(*JUMP_WITHIN_S))
    sensors, commands = WAYS[late.way]
    return replace(case, conditions=Conditions(jump=Jump(at_s, late.ms / 1000.0, sensors, commands)))


def _at_a_wall(gap_m: float, tilt: float, share: float) -> Case:
    far = objects.RADIUS_M / math.cos(tilt) + gap_m + 0.05  # half of the wall's thickness
    across = math.pi / 2.0 + tilt
    dx, dy = 1.5 * math.cos(across), 1.5 * math.sin(across)
    wall = Wall(name="wall", start=(far - dx, -dy), end=(far + dx, dy))
    size = (-objects.ROOM_M, -objects.ROOM_M, objects.ROOM_M, objects.ROOM_M)
    world = World(name="one wall", size=size, walls=[wall])
    return Case(world, Pose(0.0, 0.0, 0.0), lambda _: FullStick(1.0, 0.0, share), 15.0)
