"""Input filters: a chain of named steps, configured for each robot, from stick to requested velocity. Pure.

A step maps a stick position to a stick position. Only the two smoothing steps, which remove the tremor of a
hand, have a memory. They never delay a stop: a released axis is zero at once, a reversed axis changes its
sign at once, and memory older than `COMMAND_LIFE_S` is dropped. No step returns a larger value than the hand
has just given on this axis.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, NamedTuple

from msgspec import Meta, Struct

from robots.shared.sentences import joined, say

COMMAND_LIFE_S = 0.3  # a command is valid for this time; after a longer gap, smoothing starts again
SHORTEST_S = 0.005  # shortest assumed time between two commands: the commands of a burst arrive together

Factor = Annotated[float, Meta(ge=0.0, le=1.0)]
Hertz = Annotated[float, Meta(gt=0.0, le=20.0)]
AxisMemory = tuple[float, ...]  # of a smoothing step; the first value is its last output


class StickPosition(NamedTuple):
    """A stick position: forward, left, turn left; each -1..1."""

    x: float
    y: float
    w: float


Memory = tuple[AxisMemory, AxisMemory, AxisMemory]  # for x, y and w


# --- steps without memory ------------------------------------------------------------------------


class Scale(Struct, frozen=True, tag_field="step", tag="scale"):
    """Scale an axis: 0.5 halves it."""

    x: Factor = 1.0
    y: Factor = 1.0
    w: Factor = 1.0

    def __call__(self, position: StickPosition) -> StickPosition:
        return StickPosition(position.x * self.x, position.y * self.y, position.w * self.w)


class DeadZone(Struct, frozen=True, tag_field="step", tag="dead_zone"):
    """Set an axis to zero within `width` of its middle. Scale the rest to the full range, without a jump."""

    width: Annotated[float, Meta(ge=0.0, le=0.5)] = 0.03

    def __call__(self, position: StickPosition) -> StickPosition:
        return StickPosition(*(self._beyond(axis) for axis in position))

    def _beyond(self, axis: float) -> float:
        size = (abs(axis) - self.width) / (1.0 - self.width)
        return math.copysign(size, axis) if size > 0.0 else 0.0


class Curve(Struct, frozen=True, tag_field="step", tag="curve"):
    """Raise an axis to the power of `exponent` (1: linear): fine near the middle, full speed at the rim."""

    exponent: Annotated[float, Meta(ge=1.0, le=4.0)] = 1.0

    def __call__(self, position: StickPosition) -> StickPosition:
        return StickPosition(*(math.copysign(abs(axis) ** self.exponent, axis) for axis in position))


class Snap(Struct, frozen=True, tag_field="step", tag="snap"):
    """Turn on the spot, at `share` of the turn, if the stick points sideways.

    Sideways: within `within_deg` of +-90 degrees. This step changes nothing while the stick also asks for
    lateral motion.
    """

    within_deg: Annotated[float, Meta(gt=0.0, le=45.0)] = 15.0
    share: Annotated[float, Meta(gt=0.0, le=1.0)] = 0.25

    def __call__(self, position: StickPosition) -> StickPosition:
        """Return the position, or only its turn."""
        from_sideways = math.atan2(abs(position.x), abs(position.w))
        if position.w == 0.0 or position.y != 0.0 or from_sideways > math.radians(self.within_deg):
            return position
        return StickPosition(0.0, 0.0, position.w * self.share)


# --- smoothing steps ------------------------------------------------------------------------------


class OneEuro(Struct, frozen=True, tag_field="step", tag="one_euro"):
    """The One-Euro filter (Casiez et al., 2012): a low pass whose cutoff rises with the stick's speed.

    It removes the tremor of a resting hand and hardly delays a moving hand. Cutoff: `min_hz` + `beta` x speed
    (axis ranges a second). The speed is smoothed by a low pass with cutoff `speed_hz`.
    """

    min_hz: Hertz = 1.0
    beta: Annotated[float, Meta(ge=0.0, le=50.0)] = 5.0
    speed_hz: Hertz = 1.0

    def begin(self, axis: float) -> AxisMemory:
        """Return the memory after a first input `axis`: output, speed, input."""
        return axis, 0.0, axis

    def follow(self, memory: AxisMemory, axis: float, dt_s: float) -> AxisMemory:
        """Return the memory after the hand moved to `axis`."""
        given, speed, held = memory
        speed += _weight(self.speed_hz, dt_s) * ((axis - held) / dt_s - speed)
        given += _weight(self.min_hz + self.beta * abs(speed), dt_s) * (axis - given)
        return given, speed, axis


class Mean(Struct, frozen=True, tag_field="step", tag="mean"):
    """The mean of the newest inputs: at most `count`, none older than an input that differs.

    An input differs if it is more than `similar` (axis ranges) away from the newest input. A simple filter,
    for comparison with One-Euro. docs/figures.md gives its lag and jitter at 0.4.
    """

    count: Annotated[int, Meta(ge=2, le=20)] = 5
    similar: Annotated[float, Meta(gt=0.0, le=2.0)] = 0.4

    def begin(self, axis: float) -> AxisMemory:
        """Return the memory after a first input `axis`: output, then inputs, newest first."""
        return axis, axis

    def follow(self, memory: AxisMemory, axis: float, dt_s: float) -> AxisMemory:
        """Return the memory after the hand moved to `axis`."""
        held = [axis]
        for before in memory[1 : self.count]:
            if abs(before - axis) > self.similar:
                break
            held.append(before)
        return sum(held) / len(held), *held


def _weight(cutoff_hz: float, dt_s: float) -> float:
    """Return the weight of the newest value in a first-order low pass."""
    return 1.0 / (1.0 + 1.0 / (2.0 * math.pi * cutoff_hz * dt_s))


def smooth(step: OneEuro | Mean, memory: Memory | None, position: StickPosition, dt_s: float) -> Memory:
    """Return the new memory of `step`; the first value of each axis is its output.

    The filter is bypassed at zero and at a reversal.
    """
    if memory is None or dt_s > COMMAND_LIFE_S:
        return step.begin(position.x), step.begin(position.y), step.begin(position.w)
    dt_s = max(dt_s, SHORTEST_S)

    def follow(before: AxisMemory, axis: float) -> AxisMemory:
        # Compare signs: the product of two very small values is 0.
        let_go_or_reversed = axis == 0.0 or (axis > 0.0 > before[0]) or (axis < 0.0 < before[0])
        return step.begin(axis) if let_go_or_reversed else step.follow(before, axis, dt_s)

    return follow(memory[0], position.x), follow(memory[1], position.y), follow(memory[2], position.w)


# --- the chain -----------------------------------------------------------------------------------

StickStep = Scale | DeadZone | Curve | OneEuro | Mean | Snap
SMOOTHING = (OneEuro, Mean)
STEPS = {str(step.__struct_config__.tag): step for step in (Scale, DeadZone, Curve, OneEuro, Mean, Snap)}
DEFAULT: tuple[StickStep, ...] = (DeadZone(), Curve(), OneEuro())


def apply_filters(
    steps: Sequence[StickStep], memory: Memory | None, position: StickPosition, dt_s: float
) -> tuple[StickPosition, Memory | None]:
    """Return the filtered position, `dt_s` after the previous one, and the new memory of the smoothing step.

    `memory` None: this is the first position. A chain has at most one smoothing step (`stick_problems`).
    """
    for step in steps:
        if isinstance(step, SMOOTHING):
            memory = smooth(step, memory, position, dt_s)
            position = StickPosition(*(axis[0] for axis in memory))
        else:
            position = step(position)
    return position, memory


def describe(steps: Sequence[StickStep]) -> str:
    """Describe the chain for an operator."""
    words = list(filter(None, map(_words, steps)))
    return joined(", ", words) if words else say("no filter")


def _words(step: StickStep) -> str:
    match step:
        case Scale(x, y, w):
            return say("scaled (forward {x}, left {y}, turn {w})", x=_short(x), y=_short(y), w=_short(w))
        case DeadZone(width):
            return say("dead zone {width}", width=_short(width)) if width else ""
        case Curve(exponent):
            return say("curve {exponent}", exponent=_short(exponent)) if exponent != 1.0 else ""
        case OneEuro():
            return say("smoothed (One-Euro)")
        case Mean(count):
            return say("smoothed (mean of {count})", count=count)
        case Snap(_, share):
            return say("sideways turns on the spot at {share:.0f}%", share=100.0 * share)


def _short(number: float) -> float:
    """Return a number that is shown with as few digits as it needs."""
    return int(number) if number == int(number) else number
