"""Replay recorded near misses through the current gate, and check its answers against the true scene.

The answers of an improved gate may differ. Then only the last test fails.
"""

from __future__ import annotations

import bisect
import math
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
import pytest

from robots.bridge.gate_trace import Decision, replay
from robots.shared.geometry.poses import Velocity

TRACES = sorted((Path(__file__).parents[2] / "data" / "traces").glob("*.gate"))
THINGS = [path for path in TRACES if not path.stem.startswith("doorway")]
MADE_BY = "python -m benchmarks.world.near_misses tests/data/traces"
# The robot moves as in MuJoCo, not as in the gate's model.
ANSWERS_S = 0.2
BRAKES_MPS2 = 1.0
SEES_S = 0.25  # s, age of moving obstacles in the sensor data


class Truth(NamedTuple):
    """The true obstacles in the world frame."""

    radius_m: float
    outline: np.ndarray  # (N, 2)
    poses: list[tuple[float, float, float]]
    people: list[list[tuple[float, float, float]]]

    def gap_m(self, number: int, seen: int, twist: Velocity) -> float:
        """Return the least gap (m) if `twist` is the last, at decision `number`.

        People are at their places at decision `seen`.
        """
        way = way_of(self.poses[number], twist)
        gaps = [math.inf]
        if len(self.outline):
            gaps.append(np.linalg.norm(way[:, None] - self.outline, axis=2).min())
        gaps += [np.linalg.norm(way - (x, y), axis=1).min() - radius for x, y, radius in self.people[seen]]
        return float(min(gaps)) - self.radius_m


def way_of(pose: tuple[float, float, float], twist: Velocity) -> np.ndarray:
    """Return the path of the robot's centre in steps of 1 cm: it drives with `twist`, then brakes."""
    speed = abs(twist.vx)
    length = speed * ANSWERS_S + speed**2 / (2.0 * BRAKES_MPS2)
    along = np.linspace(0.0, length, max(math.ceil(length / 0.01), 1) + 1)
    yaw = pose[2] + (along * twist.w / speed if speed else 0.0 * along)
    step = math.copysign(along[1], twist.vx)
    x = pose[0] + step * np.concatenate(([0.0], np.cumsum(np.cos((yaw[1:] + yaw[:-1]) / 2.0))))
    y = pose[1] + step * np.concatenate(([0.0], np.cumsum(np.sin((yaw[1:] + yaw[:-1]) / 2.0))))
    return np.stack((x, y), axis=1)


def truth_of(path: Path) -> Truth:
    stored = msgspec.json.decode(path.with_suffix(".json").read_bytes())
    return Truth(stored["radius_m"], np.array(stored["outline"]), stored["poses"], stored["people"])


def gaps(truth: Truth, decisions: list[Decision], twists: list[Velocity]) -> np.ndarray:
    times = [decision.now_s for decision in decisions]
    seen = [max(bisect.bisect_right(times, now_s - SEES_S) - 1, 0) for now_s in times]
    return np.array([truth.gap_m(n, seen[n], twist) for n, twist in enumerate(twists)])


def gap_to_people_m(truth: Truth, decisions: list[Decision]) -> float:
    """Return the least gap (m) to people, who walk on, if from some decision on the robot drives straight as asked."""
    times = np.array([decision.now_s for decision in decisions])
    least_m = math.inf
    for n, ((x, y, yaw), decision) in enumerate(zip(truth.poses, decisions, strict=True)):
        along = decision.asked.vx * (times[n:] - times[n])
        way = np.stack((x + along * math.cos(yaw), y + along * math.sin(yaw)), axis=1)
        for at, people in zip(way, truth.people[n:], strict=True):
            gaps_m = [math.dist(at, person[:2]) - person[2] - truth.radius_m for person in people]
            least_m = min([least_m, *gaps_m])
    return least_m


@pytest.fixture(scope="module", params=TRACES, ids=lambda path: path.stem)
def path(request) -> Path:
    return request.param


@pytest.fixture(scope="module")
def decisions(path) -> list[Decision]:
    return list(replay(path))


def test_near_misses_cover_leg_table_top_door_and_person():
    assert {path.stem.split("_")[0] for path in TRACES} >= {"table", "doorway", "person"}
    assert all(path.stat().st_size < 100_000 for path in TRACES)


def test_allowed_twist_lets_the_robot_brake_before_obstacles(path, decisions):
    truth = truth_of(path)
    assert len(truth.poses) == len(decisions)
    assert gaps(truth, decisions, [decision.replayed.velocity for decision in decisions]).min() > 0.0


@pytest.mark.parametrize("path", THINGS, ids=lambda path: path.stem)
def test_without_the_gate_the_robot_would_have_collided(path):
    decisions, truth = list(replay(path)), truth_of(path)
    standing_m = gaps(truth, decisions, [decision.asked for decision in decisions]).min()
    assert min(standing_m, gap_to_people_m(truth, decisions)) < 0.0


def test_through_a_door_it_lets_a_competent_driver_pass():
    [door] = [path for path in TRACES if path.stem.startswith("doorway")]
    decisions = list(replay(door))
    answered = sum(decision.replayed.velocity.vx for decision in decisions)
    assert answered >= 0.8 * sum(decision.asked.vx for decision in decisions)


def test_the_same_drive_has_the_same_answers_bit_for_bit(path, decisions):
    again = list(replay(path))
    encode = msgspec.msgpack.Encoder(enc_hook=str).encode
    assert [encode(one.replayed) for one in again] == [encode(one.replayed) for one in decisions]


def test_this_version_answers_as_it_is_recorded(path, decisions):
    """Compare to a millionth: the last bits of a result differ on other processors."""
    other = [
        f"{one.now_s:.2f} s: recorded {one.recorded}, now {one.replayed}"
        for one in decisions
        if (one.recorded.code, one.recorded.sensor) != (one.replayed.code, one.replayed.sensor)
        or not np.allclose(one.recorded.velocity, one.replayed.velocity, rtol=0.0, atol=1e-6)
    ]
    hint = f"If the gate was changed on purpose, make the traces anew: {MADE_BY}"
    assert not other, f"{len(other)} answers of {len(decisions)} are not as recorded.\n{hint}\n{other[0]}"
