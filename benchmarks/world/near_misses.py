"""Make the short traces of near misses that tests replay: python -m benchmarks.world.near_misses DIRECTORY.

Beside each trace stands the truth, which the gate never sees: where the robot and everything around it really was
at each decision.
"""

from __future__ import annotations

import argparse
import gzip
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import cast

import msgspec
import numpy as np
from msgspec import structs

from benchmarks.world.cases import crossing, doors, objects
from benchmarks.world.controllers import Fan, GateController, Output, Ranges
from benchmarks.world.loop import Case, Loop
from benchmarks.world.play import SCAN, recorded
from benchmarks.world.robot import tiago_profile
from benchmarks.world.truth import RADIUS_M, Truth
from robots.bridge.gate.sensing.depth import Transform
from robots.shared.configuration.gate_profile import GateProfile
from robots.shared.geometry.poses import Pose, Velocity
from robots.simulator.physics.mujoco_world import Pose as TruePose
from robots.simulator.robot import Robot

Point = tuple[float, float]
SEED = 2
# Cases with depth pictures; in the others the laser sees enough, and pictures make large files
LOOKS = {"table_top"}
CASES: dict[str, Callable[[], Case]] = {
    "table_leg_at_45_degrees": lambda: replace(
        objects.build(objects.ObjectJob("gate", "table leg", 45, 1.0, SEED)), longest_s=3.2
    ),
    "table_top": lambda: replace(
        objects.build(objects.ObjectJob("gate", "table top", 0, 1.0, 1)), longest_s=3.7
    ),
    "doorway_of_70_cm": lambda: replace(
        doors.build(0.70, SEED), start=TruePose(1.0, 0.08, -0.1), longest_s=4.5
    ),
    "person_crossing": lambda: replace(crossing.build(1.0, SEED), longest_s=4.2),
}


class Witnessed(msgspec.Struct, frozen=True):
    """The truth of a trace, in the world's frame; metres and radians."""

    radius_m: float  # of the robot
    outline: list[Point]  # of all standing objects, every few centimetres
    poses: list[Pose]  # of the robot, at each decision
    people: list[list[tuple[float, float, float]]]  # x, y, radius of each, at each decision


class Witness(GateController):
    """Our gate with coarse sensors, which make small files. It also stores the truth.

    The laser has steps of 1 mm. The depth camera has the steps of structured light, and keeps one of `_THIN`
    by `_THIN` pixels.
    """

    robot: Robot
    _DISPARITY = 0.005  # between two distances that the camera can separate, 1/m
    _THIN = 10

    def __init__(self, profile: GateProfile, fan: Fan) -> None:
        super().__init__(profile, fan)
        self.looks = profile.has_depth
        self.poses: list[Pose] = []
        self.people: list[list[tuple[float, float, float]]] = []

    def scan(self, stamp_s: float, arrival_s: float, ranges: Ranges) -> None:
        super().scan(stamp_s, arrival_s, np.round(ranges, 3))

    def depth(self, stamp_s: float, arrival_s: float, metres: Ranges, to_base: Transform) -> None:
        disparity = np.round(1.0 / metres[:: self._THIN, :: self._THIN] / self._DISPARITY) * self._DISPARITY
        coarse = (1.0 / disparity).astype(np.float32)
        super().depth(stamp_s, arrival_s, coarse.repeat(self._THIN, 0).repeat(self._THIN, 1), to_base)

    def decide(self, asked: Velocity, sent: Velocity, now_s: float) -> Output:
        self.poses.append(Pose(*(round(axis, 4) for axis in self.robot.physics.pose)))
        self.people.append(
            [(round(one.x, 4), round(one.y, 4), one.person.radius) for one in self.robot.people.values()]
        )
        return super().decide(asked, sent, now_s)


def main() -> int:
    """Write all traces. Return 1 if a robot touched something: then this is not a near miss."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.world.near_misses", description=__doc__)
    parser.add_argument("directory", type=Path)
    directory: Path = parser.parse_args().directory
    directory.mkdir(parents=True, exist_ok=True)
    return max(_made(directory / name, case()) for name, case in CASES.items())


def _made(path: Path, case: Case) -> int:
    profile = tiago_profile()
    if path.name not in LOOKS:
        profile = structs.replace(profile, has_depth=False, depth=None)
    loop = Loop(case, lambda fan: Witness(profile, fan), profile.limits, SCAN, SEED)
    witness = cast(Witness, loop.controller)
    witness.robot = loop.robot
    file = path.with_suffix(".gate")
    outline = [] if case.world.people else Truth(loop.robot.physics).points.round(3).tolist()
    trace = recorded(loop, file)
    # Compress again, smaller and without a date: the same drive gives the same file.
    file.write_bytes(gzip.compress(gzip.decompress(file.read_bytes()), 9, mtime=0))
    truth = Witnessed(RADIUS_M, outline, witness.poses, witness.people)
    path.with_suffix(".json").write_bytes(msgspec.json.encode(truth) + b"\n")
    gap_m = min(moment.gap_m for moment in trace.moments)
    print(f"{file.name}: {trace.time_s:.1f} s, {file.stat().st_size / 1000:.0f} kB, {gap_m:.3f} m")
    return 1 if trace.touches else 0


if __name__ == "__main__":
    sys.exit(main())
