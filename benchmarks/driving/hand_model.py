"""A model of a hand on a stick. ``python -m benchmarks.driving.hand_model`` writes its recorded traces.

The hand's intention is a chain of minimum-jerk movements (Flash and Hogan, 1985) with rests between them: to
another direction and deflection, to the opposite position, or letting go. The stick measures the intention 60
times a second, with the physiological tremor of a hand (8 to 12 Hz, on both axes, none after letting go) and
the sensor's resolution. Tremor and resolution are shares of the stick's range: 0.01 to 0.025 rms, and one
pixel of 60.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

RATE_HZ = 60
RESOLUTION = 60
TREMORS = (0.01, 0.015, 0.02, 0.025)
TREMOR_HZ = (8.0, 12.0)
SINES = 6  # in the tremor of one axis
TRACE_S = 40.0
RECORDED = Path(__file__).parents[1] / "data" / "hands.json"

Array = NDArray[np.float64]  # times (N,), or positions (N, 2): forward, turn left


class Movement(NamedTuple):
    """A minimum-jerk movement from the hand's position to (x, w), both -1..1.

    It begins after the previous one.
    """

    start_s: float
    duration_s: float
    x: float
    w: float

    @property
    def ends_s(self) -> float:
        """Return the time at which the hand arrives."""
        return self.start_s + self.duration_s

    @property
    def lets_go(self) -> bool:
        """Return whether the hand leaves the stick, which springs back."""
        return self.x == 0.0 == self.w


class Trace(NamedTuple):
    """One hand, and the stick's measurements of it."""

    movements: list[Movement]
    times_s: Array
    measured: Array


def meant(movements: Sequence[Movement], times_s: Array) -> Array:
    """Return the intended position at each time."""
    there, from_here = np.zeros((len(times_s), 2)), np.zeros(2)
    for movement in movements:
        after = times_s >= movement.start_s
        share = minimum_jerk((times_s[after] - movement.start_s) / movement.duration_s)[:, None]
        to_there = np.array([movement.x, movement.w])
        there[after] = from_here + share * (to_there - from_here)
        from_here = to_there
    return there


def minimum_jerk(share: Array) -> Array:
    """Return the share of the way that is done after a share of the time (Flash and Hogan, 1985)."""
    share = np.clip(share, 0.0, 1.0)
    done: Array = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    return done


def measured(positions: Array, times_s: Array, tremor: float, chance: Generator) -> Array:
    """Return the measured stick positions: with this tremor (rms), in steps of the sensor's resolution."""
    held = ~(positions == 0.0).all(axis=1)
    shaken = positions + held[:, None] * tremor * np.column_stack([_tremor(times_s, chance) for _ in "xw"])
    steps: Array = np.clip(np.round(shaken * RESOLUTION), -RESOLUTION, RESOLUTION)
    return steps / RESOLUTION


def _tremor(times_s: Array, chance: Generator) -> Array:
    """Return a tremor of 1 rms."""
    frequencies = chance.uniform(*TREMOR_HZ, SINES)
    phases = chance.uniform(0.0, 2.0 * math.pi, SINES)
    waves = np.sin(2.0 * math.pi * frequencies * times_s[:, None] + phases)
    tremor: Array = waves.sum(axis=1) / math.sqrt(SINES / 2.0)
    return tremor


# --- the recorded traces -------------------------------------------------------------------------


def _wander(chance: Generator) -> list[Movement]:
    """Return the intention of a hand for `TRACE_S`: half moves, a sixth each reversals, releases and rests."""
    movements: list[Movement] = []
    here = np.zeros(2)
    now_s = 0.5
    while now_s < TRACE_S - 3.0:
        kind = chance.uniform()
        angle, deflection = chance.uniform(-math.pi, math.pi), chance.uniform(0.4, 1.0)
        there = deflection * np.array([math.cos(angle), math.sin(angle)])
        duration_s = chance.uniform(0.25, 0.55) + 0.4 * float(np.linalg.norm(there - here))
        if here.any() and kind < 1 / 6:
            there, duration_s = -here, chance.uniform(0.4, 0.8)
        elif here.any() and kind < 1 / 3:
            there, duration_s = np.zeros(2), chance.uniform(0.1, 0.2)
        x, w = (round(float(axis), 3) for axis in there)
        movements.append(Movement(round(now_s, 3), round(duration_s, 3), x, w))
        here = there
        now_s += duration_s + chance.uniform(0.4, 2.0)
    return movements


def record(path: Path = RECORDED) -> None:
    """Write the traces that the benchmark uses: two hands of each tremor."""
    hands = []
    for seed, tremor in enumerate(TREMORS * 2):
        chance = np.random.default_rng(seed)
        movements = _wander(chance)
        times_s = np.arange(round(TRACE_S * RATE_HZ)) / RATE_HZ
        steps = measured(meant(movements, times_s), times_s, tremor, chance) * RESOLUTION
        x, w = np.rint(steps).astype(int).T.tolist()
        hands.append({"tremor": tremor, "movements": movements, "x": x, "w": w})
    facts = {"rate_hz": RATE_HZ, "resolution": RESOLUTION, "hands": hands}
    path.write_text(json.dumps(facts, separators=(",", ":")) + "\n", encoding="utf-8")


def recorded() -> list[Trace]:
    """Return the traces of the repository."""
    facts = json.loads(RECORDED.read_text(encoding="utf-8"))
    return [
        Trace(
            movements=[Movement(*movement) for movement in hand["movements"]],
            times_s=np.arange(len(hand["x"])) / facts["rate_hz"],
            measured=np.column_stack([hand["x"], hand["w"]]) / facts["resolution"],
        )
        for hand in facts["hands"]
    ]


if __name__ == "__main__":
    record()
