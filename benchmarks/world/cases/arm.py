"""The arm moves in the camera's view and folds again. Then the robot drives ahead, in an empty hall.

In the description some links at the arm's tip are missing; the seed chooses how many. The bridge cannot know
where these links are. The hall is empty, so only the robot's own arm can cause a refusal or hold the robot.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from benchmarks.harness import Figure, progress
from benchmarks.world.arm import ArmShow
from benchmarks.world.cases.objects import ROOM_M
from benchmarks.world.drivers import FullStick
from benchmarks.world.loop import Case, Conditions
from benchmarks.world.play import loop_of, played
from benchmarks.world.sensors import Sensors
from robots.simulator.physics.mujoco_world import Pose
from robots.simulator.worlds import World

MOTIONS = ("wave", "unfold_arm", "reach_max", "reach_floor")
MOST_LACKING = 3  # gripper, and the two last joints
DRIVES_MPS = 0.2
LONGEST_S = 60.0
TRIES_S = 12.0
LIMIT_S = 5.0
WORST = 3


class End(NamedTuple):
    """Seconds of refused motions, and from the arm at home until the robot drove (`TRIES_S`: never)."""

    refused_s: float
    held_s: float


def measure(repeats: int) -> list[Figure]:
    """Return the longest refusal and the longest hold, by the number of missing links."""
    seeds = range(len(MOTIONS) * (MOST_LACKING + 1) * repeats)
    done = list(played("arm", seeds, play))
    for seed, end in sorted(done, key=lambda pair: -max(pair[1]))[:WORST]:
        progress(f"python -m benchmarks.world arm {seed} --quiet  # {end}")
    figures = []
    for lacks in range(MOST_LACKING + 1):
        ends = [end for seed, end in done if build(seed).arm == ArmShow((_motion(seed), "home"), lacks)]
        name = f"arm, {lacks} links missing, {len(ends)} runs"
        figures.append(Figure(f"{name}: refused for", max(end.refused_s for end in ends), "s", 0.0))
        figures.append(Figure(f"{name}: drives after", max(end.held_s for end in ends), "s", LIMIT_S))
    return figures


def play(seed: int) -> End:
    """Play the case of a seed."""
    loop = loop_of(build(seed), "gate", seed)
    trying = [moment for moment in loop.play().moments if moment.trying]
    drives = (moment.time_s for moment in trying if moment.sent.vx >= DRIVES_MPS)
    held_s = next(drives, trying[0].time_s + TRIES_S) - trying[0].time_s
    return End(loop.arm.refused_s if loop.arm else 0.0, held_s)


def build(seed: int) -> Case:
    random = np.random.default_rng([seed, 29])
    world = World(name="hall", size=(-ROOM_M, -ROOM_M, ROOM_M, ROOM_M))
    lacks = seed // len(MOTIONS) % (MOST_LACKING + 1)
    return Case(
        world,
        Pose(-ROOM_M / 2.0, 0.0, 0.0),
        lambda _: FullStick(1.0, 0.0, 0.5),
        LONGEST_S,
        at_rest_s=TRIES_S,
        tries_s=TRIES_S,
        conditions=Conditions(sensors=Sensors.drawn(random)),
        arm=ArmShow((_motion(seed), "home"), lacks),
    )


def _motion(seed: int) -> str:
    return MOTIONS[seed % len(MOTIONS)]
