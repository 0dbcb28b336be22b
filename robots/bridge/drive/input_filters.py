"""From a stick position to the requested twist: a chain of named filter steps, configured for each robot. Pure.

A step maps one stick position to another. Two steps have memory: they smooth the tremor of a hand. They never delay a
stop: an axis at zero is zero at once, a reversed axis reverses at once, and values older than a command's life are
dropped. No step makes an axis larger than the hand's own position.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, NamedTuple

from msgspec import Meta, Struct

COMMAND_LIFE_S = 0.3  # of every command; what was held before such a gap says nothing of the hand now
SHORTEST_S = 0.005  # two commands of one burst are taken to be this far apart

Factor = Annotated[float, Meta(ge=0.0, le=1.0)]
Hertz = Annotated[float, Meta(gt=0.0, le=20.0)]
AxisMemory = tuple[float, ...]  # of a steadying step; the first is what it gave last


class StickPosition(NamedTuple):
    """A stick position: forward, left, turn left; each -1..1."""

    x: float
    y: float
    w: float


Memory = tuple[AxisMemory, AxisMemory, AxisMemory]  # of x, y and w


# --- steps without memory ------------------------------------------------------------------------


class Scale(Struct, frozen=True, tag_field="step", tag="scale"):
    """Less of an axis: 0.5 halves it."""

    x: Factor = 1.0
    y: Factor = 1.0
    w: Factor = 1.0

    def __call__(self, position: StickPosition) -> StickPosition:
        """The position, scaled."""
        return StickPosition(position.x * self.x, position.y * self.y, position.w * self.w)


class DeadZone(Struct, frozen=True, tag_field="step", tag="dead_zone"):
    """Nothing within `width` of an axis' middle; beyond it the whole range, without a jump."""

    width: Annotated[float, Meta(ge=0.0, le=0.5)] = 0.03

    def __call__(self, position: StickPosition) -> StickPosition:
        """The position, its small values at zero."""
        return StickPosition(*(self._beyond(axis) for axis in position))

    def _beyond(self, axis: float) -> float:
        size = (abs(axis) - self.width) / (1.0 - self.width)
        return math.copysign(size, axis) if size > 0.0 else 0.0


class Curve(Struct, frozen=True, tag_field="step", tag="curve"):
    """Fine near the middle, full at the rim: the axis to the power of `exponent`; 1 is linear."""

    exponent: Annotated[float, Meta(ge=1.0, le=4.0)] = 1.0

    def __call__(self, position: StickPosition) -> StickPosition:
        """The position, bent."""
        return StickPosition(*(math.copysign(abs(axis) ** self.exponent, axis) for axis in position))


class Snap(Struct, frozen=True, tag_field="step", tag="snap"):
    """A stick held sideways, within `within_deg` of +-90 degrees, turns the robot on the spot, at `share` of the turn.

    Not while the stick also asks for a slide.
    """

    within_deg: Annotated[float, Meta(gt=0.0, le=45.0)] = 15.0
    share: Annotated[float, Meta(gt=0.0, le=1.0)] = 0.25

    def __call__(self, position: StickPosition) -> StickPosition:
        """The position, or the turn alone."""
        from_sideways = math.atan2(abs(position.x), abs(position.w))
        if position.w == 0.0 or position.y != 0.0 or from_sideways > math.radians(self.within_deg):
            return position
        return StickPosition(0.0, 0.0, position.w * self.share)


# --- steadying steps -----------------------------------------------------------------------------


class OneEuro(Struct, frozen=True, tag_field="step", tag="one_euro"):
    """The One-Euro filter (Casiez et al., 2012): a low pass whose cutoff rises with the stick's speed, so that a hand
    at rest is steadied and a hand on the move is hardly held back.

    Cutoff `min_hz` + `beta` x speed (axis ranges a second); the speed itself passes a low pass of `speed_hz`.
    """

    min_hz: Hertz = 1.0
    beta: Annotated[float, Meta(ge=0.0, le=50.0)] = 5.0
    speed_hz: Hertz = 1.0

    def begin(self, axis: float) -> AxisMemory:
        """A hand that has just come here: given, speed, held."""
        return axis, 0.0, axis

    def follow(self, memory: AxisMemory, axis: float, dt_s: float) -> AxisMemory:
        """The hand moved on to `axis`."""
        given, speed, held = memory
        speed += _weight(self.speed_hz, dt_s) * ((axis - held) / dt_s - speed)
        given += _weight(self.min_hz + self.beta * abs(speed), dt_s) * (axis - given)
        return given, speed, axis


class Mean(Struct, frozen=True, tag_field="step", tag="mean"):
    """The mean of the newest `count` inputs, as far back as they are `similar` to the newest (axis ranges).

    The former scheme. With 0.4 it shows the lag and jitter that docs/gate.md gives for it (docs/figures.md).
    """

    count: Annotated[int, Meta(ge=2, le=20)] = 5
    similar: Annotated[float, Meta(gt=0.0, le=2.0)] = 0.4

    def begin(self, axis: float) -> AxisMemory:
        """A hand that has just come here: given, then held, the newest first."""
        return axis, axis

    def follow(self, memory: AxisMemory, axis: float, dt_s: float) -> AxisMemory:
        """The hand moved on to `axis`."""
        held = [axis]
        for before in memory[1 : self.count]:
            if abs(before - axis) > self.similar:
                break
            held.append(before)
        return sum(held) / len(held), *held


def _weight(cutoff_hz: float, dt_s: float) -> float:
    """Of the newest value in a low pass of first order."""
    return 1.0 / (1.0 + 1.0 / (2.0 * math.pi * cutoff_hz * dt_s))


def smoothed(step: OneEuro | Mean, memory: Memory | None, position: StickPosition, dt_s: float) -> Memory:
    """Apply `step` to `position`; return the result and the new filter state. Zero and reversal bypass the filter."""
    if memory is None or dt_s > COMMAND_LIFE_S:
        return step.begin(position.x), step.begin(position.y), step.begin(position.w)
    dt_s = max(dt_s, SHORTEST_S)

    def follow(before: AxisMemory, axis: float) -> AxisMemory:
        # Not by their product, which is 0 for two that are small enough.
        let_go_or_reversed = axis == 0.0 or (axis > 0.0 > before[0]) or (axis < 0.0 < before[0])
        return step.begin(axis) if let_go_or_reversed else step.follow(before, axis, dt_s)

    return follow(memory[0], position.x), follow(memory[1], position.y), follow(memory[2], position.w)


# --- the chain -----------------------------------------------------------------------------------

StickStep = Scale | DeadZone | Curve | OneEuro | Mean | Snap
STEADYING = (OneEuro, Mean)
STEPS = {str(step.__struct_config__.tag): step for step in (Scale, DeadZone, Curve, OneEuro, Mean, Snap)}
DEFAULT: tuple[StickStep, ...] = (DeadZone(), Curve(), OneEuro())


def apply_filters(
    steps: Sequence[StickStep], memory: Memory | None, position: StickPosition, dt_s: float
) -> tuple[StickPosition, Memory | None]:
    """Apply all steps to a position that came `dt_s` after the last; return the result and the filter state.

    `memory` None: nothing came before. There is at most one steadying step (`stick_problems`).
    """
    for step in steps:
        if isinstance(step, STEADYING):
            memory = smoothed(step, memory, position, dt_s)
            position = StickPosition(*(axis[0] for axis in memory))
        else:
            position = step(position)
    return position, memory


def describe(steps: Sequence[StickStep]) -> str:
    """Describe the filters in words, for operators."""
    return ", ".join(filter(None, map(_words, steps))) or "as it is"


def _words(step: StickStep) -> str:
    match step:
        case Scale(x, y, w):
            return f"scaled (forward {x:g}, left {y:g}, turn {w:g})"
        case DeadZone(width):
            return f"dead zone {width:g}" if width else ""
        case Curve(exponent):
            return f"curve {exponent:g}" if exponent != 1.0 else ""
        case OneEuro():
            return "steadied (One-Euro)"
        case Mean(count):
            return f"steadied (mean of {count})"
        case Snap(_, share):
            return f"sideways turns on the spot at {share:.0%}"
