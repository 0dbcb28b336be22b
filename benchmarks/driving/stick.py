"""Effect of smoothing on a hand at the stick: none, the mean of similar inputs, One-Euro.

Recorded hands (`benchmarks.driving.hand_model`), reduced to the page's 30 commands a second and to 20:

* jitter: rms distance of a resting hand's output from its mean, percent of the stick's range;
* lag: time shift at which the output fits the hand's intention best;
* stop lag: from the first zero of a released stick to zero output, worst.

A table of turns, at the page's rate: the stick's direction goes from 0 to 45, 90, 135 and 180 degrees in 2
and in 5 s. *Difference* is the mean angle between the directions of two successive commands. *Improvement* is
the difference without a filter relative to the difference with it, minus 1, in percent. If the hand itself
turns far between two commands, a filter must not remove this turn, so the improvement is small.

Results: over the recorded hands One-Euro lags less than half as much as the mean. In every row of the table
its difference is smaller than without a filter and slightly smaller than with the mean. But a resting hand
has less jitter with the mean, especially at 20 commands a second. In slow rows One-Euro, like any low pass,
lags by more than 30 ms: 63 ms at 9 degrees a second, which is half a degree. No setting has both little
jitter and little lag (docs/decisions/the-stick-filter-lags-at-slow-movements.md).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from benchmarks.driving import hand_model
from benchmarks.driving.hand_model import Array, Movement, Trace
from benchmarks.harness import Figure, progress
from robots.shared.configuration.input_filters import (
    Mean,
    Memory,
    OneEuro,
    StickPosition,
    StickStep,
    apply_filters,
)

PAGE_HZ = 30
SCHEMES: dict[str, tuple[StickStep, ...]] = {"none": (), "mean": (Mean(),), "One-Euro": (OneEuro(),)}
SETTLED_S = 0.3  # at the start of a rest, in which jitter does not count
NOTHING = 0.02
LAGS_S = np.arange(-0.02, 0.15, 0.001)
LAG_MS = 30.0
JITTER_SHARE = 0.3  # of the jitter without a filter

RANGES_DEG = (45, 90, 135, 180)
TRANSITIONS_S = (2.0, 5.0)
SWEEPS = 64  # of each row, sixteen with each tremor
AROUND_S = 1.0  # the hand rests before and after a sweep
DEFLECTION = 0.9


def measure() -> list[Figure]:
    """Return all figures."""
    figures: list[Figure] = []
    for rate_hz in (PAGE_HZ, 20):
        progress(f"recorded hands at {rate_hz} commands a second ...")
        figures += _hands(rate_hz)
    for transition_s in TRANSITIONS_S:
        for degrees in RANGES_DEG:
            progress(f"0-{degrees} degrees in {transition_s:g} s ...")
            figures += _row(degrees, transition_s)
    return figures


def through(steps: Sequence[StickStep], positions: Array, rate_hz: float) -> Array:
    """Return the output of a chain of filter steps for a hand."""
    memory: Memory | None = None
    given = np.empty_like(positions)
    for index, (x, w) in enumerate(positions.tolist()):
        position, memory = apply_filters(steps, memory, StickPosition(x, 0.0, w), 1.0 / rate_hz)
        given[index] = position.x, position.w
    return given


def lag_ms(given: Array, times_s: Array, meant: Callable[[Array], Array]) -> float:
    """Return the time shift at which the output fits the intention best."""
    misses = [float(np.mean((given - meant(times_s - lag_s)) ** 2)) for lag_s in LAGS_S]
    return 1000.0 * float(LAGS_S[int(np.argmin(misses))])


# --- recorded hands ------------------------------------------------------------------------------


def _hands(rate_hz: int) -> list[Figure]:
    traces = [_thinned(trace, rate_hz) for trace in hand_model.recorded()]
    figures: list[Figure] = []
    jitter_without = math.nan
    for name, steps in SCHEMES.items():
        given = [through(steps, trace.measured, rate_hz) for trace in traces]
        jitter = _jitter(traces, given)
        jitter_without = jitter if name == "none" else jitter_without
        lags = [_lag_of(trace, one) for trace, one in zip(traces, given, strict=True)]
        judged = name == "One-Euro"
        of = f"{rate_hz} Hz, {name}"
        figures += [
            Figure(f"{of}: jitter", 100.0 * jitter, "%"),
            Figure(f"{of}: of none's jitter", jitter / jitter_without, "", JITTER_SHARE if judged else None),
            Figure(f"{of}: lag", float(np.mean(lags)), "ms", LAG_MS if judged else None),
            Figure(f"{of}: stop lag", _stop_lag_ms(traces, given), "ms", 0.0 if judged else None),
        ]
    return figures


def _thinned(trace: Trace, rate_hz: int) -> Trace:
    every = hand_model.RATE_HZ // rate_hz
    return Trace(trace.movements, trace.times_s[::every], trace.measured[::every])


def _jitter(traces: Sequence[Trace], given: Sequence[Array]) -> float:
    squares: list[float] = []
    for trace, one in zip(traces, given, strict=True):
        for movement, following in pairwise(trace.movements):
            if not movement.lets_go:
                resting = _between(trace.times_s, movement.ends_s + SETTLED_S, following.start_s)
                squares += list(np.var(one[resting], axis=0)) if resting.sum() > 1 else []
    return math.sqrt(float(np.mean(squares)))


def _between(times_s: Array, begin_s: float, end_s: float) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    return (times_s > begin_s) & (times_s < end_s)


def _lag_of(trace: Trace, given: Array) -> float:
    return lag_ms(given, trace.times_s, lambda times_s: hand_model.meant(trace.movements, times_s))


def _stop_lag_ms(traces: Sequence[Trace], given: Sequence[Array]) -> float:
    """Return the worst stop lag."""
    return max(
        _stop_ms(trace, one, movement)
        for trace, one in zip(traces, given, strict=True)
        for movement in trace.movements
        if movement.lets_go
    )


def _stop_ms(trace: Trace, given: Array, release: Movement) -> float:
    let_go = trace.times_s >= release.start_s
    zero = int(np.argmax(let_go & ~trace.measured.any(axis=1)))
    stopped = zero + int(np.argmax((abs(given[zero:]) < NOTHING).all(axis=1)))
    return 1000.0 * float(trace.times_s[stopped] - trace.times_s[zero])


# --- the table of turns ---------------------------------------------------------------------------


class Row(NamedTuple):
    """Mean difference (degrees) and lag (ms) of a scheme for one range and transition time."""

    difference: float
    lag: float


def _row(degrees: int, transition_s: float) -> list[Figure]:
    """Return one row of the table (a range and a transition time), at the page's rate."""
    played = {name: _played(steps, degrees, transition_s) for name, steps in SCHEMES.items()}
    row = f"0-{degrees} deg, {transition_s:g} s"
    figures = [Figure(f"{row}, none: difference", played["none"].difference, "deg")]
    for name in ("mean", "One-Euro"):
        improvement = 100.0 * (played["none"].difference / played[name].difference - 1.0)
        figures += [
            Figure(f"{row}, {name}: improvement", improvement, "%"),
            Figure(f"{row}, {name}: lag", played[name].lag, "ms"),
        ]
    for other in ("none", "mean"):
        share = played["One-Euro"].difference / played[other].difference
        figures.append(Figure(f"{row}, One-Euro / {other}", share, "", 1.0))
    return figures


def _played(steps: Sequence[StickStep], degrees: int, transition_s: float) -> Row:
    rows = []
    for seed in range(SWEEPS):
        times_s, meant, measured = _sweep(degrees, transition_s, seed)
        given = through(steps, measured, PAGE_HZ)
        rows.append((_mean_difference_deg(given, times_s, transition_s), lag_ms(given, times_s, meant)))
    return Row(*np.mean(rows, axis=0).tolist())


def _sweep(degrees: int, transition_s: float, seed: int) -> tuple[Array, Callable[[Array], Array], Array]:
    """Return times, intended and measured positions of a stick whose direction goes from 0 to `degrees`."""

    def meant(times_s: Array) -> Array:
        angle = math.radians(degrees) * hand_model.minimum_jerk((times_s - AROUND_S) / transition_s)
        return DEFLECTION * np.column_stack([np.cos(angle), np.sin(angle)])

    every = hand_model.RATE_HZ // PAGE_HZ
    times_s = np.arange(round((transition_s + 2.0 * AROUND_S) * hand_model.RATE_HZ)) / hand_model.RATE_HZ
    tremor = hand_model.TREMORS[seed % len(hand_model.TREMORS)]
    measured = hand_model.measured(meant(times_s), times_s, tremor, np.random.default_rng(seed))
    return times_s[::every], meant, measured[::every]


def _mean_difference_deg(given: Array, times_s: Array, transition_s: float) -> float:
    """Return the mean angle between the directions of two successive commands, while the hand turns."""
    directions = np.unwrap(np.arctan2(given[:, 1], given[:, 0]))
    turning = _between(times_s[1:], AROUND_S, AROUND_S + transition_s)
    return math.degrees(float(np.mean(abs(np.diff(directions))[turning])))
