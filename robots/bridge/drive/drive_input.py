"""Commands from the stick: how old they are, how long they live, what twist they ask for. Pure."""

from __future__ import annotations

from collections.abc import Sequence

from msgspec.structs import replace

from robots.bridge.drive.input_filters import COMMAND_LIFE_S, Memory, StickPosition, StickStep, apply_filters
from robots.bridge.gate.values import STILL, Limits, Velocity
from robots.wire import Drive, NeutralNeeded, Refusal

_WINDOW_S = 30.0


class AgeEstimator:
    """Age of messages by the sender's monotonic clock, without knowing its offset to ours.

    The smallest (arrival - sent) seen is taken as the offset plus the shortest way; what a
    message took beyond that is its age. The minimum is kept over the last 30 to 60 s, so that clocks
    may drift and a network may change for good.
    """

    def __init__(self) -> None:
        self._best = [float("inf"), float("inf")]  # of the window before, and of this one
        self._window_ends_s = float("-inf")

    def age_s(self, sent_s: float, now_s: float) -> float:
        """Seconds that this message is older than the fastest one seen."""
        if now_s >= self._window_ends_s:
            self._best = [self._best[1], float("inf")]
            self._window_ends_s = now_s + _WINDOW_S
        offset_s = now_s - sent_s
        self._best[1] = min(self._best[1], offset_s)
        return offset_s - min(self._best)


class DriveInput:
    """The newest command of one source (a page, its holder's tools), its stick position passed through `steps`.

    A command lives `COMMAND_LIFE_S` from when it can have been sent at the earliest. After a stop that the operator did
    not make a stick `owes` neutral: nothing moves by it before it was in the middle itself.
    """

    def __init__(self, steps: Sequence[StickStep] = ()) -> None:
        self._steps = steps
        self._memory: Memory | None = None
        self._taken_s = float("-inf")
        self._age = AgeEstimator()
        self._drive: Drive | None = None
        self._dies_s = float("-inf")
        self.owes: NeutralNeeded | None = None
        self.is_out = False  # as it was last seen, also if that command has died since

    @property
    def taken_s(self) -> float:
        """When the last command was taken."""
        return self._taken_s

    @property
    def seq(self) -> int | None:
        """Number of the last command that was taken."""
        return self._drive.seq if self._drive else None

    def take(self, drive: Drive, now_s: float) -> Refusal | None:
        """Make `drive` the newest command, or say why not."""
        if self._drive and drive.seq <= self._drive.seq:
            return Refusal(
                "out_of_order",
                f"Command {drive.seq} came after {self._drive.seq} and was dropped.",
                "dead-man",
                {"seq": drive.seq, "newest_seq": self._drive.seq},
            )
        age_s = self._age.age_s(drive.sent_ms / 1000.0, now_s)
        if age_s > COMMAND_LIFE_S:
            return Refusal(
                "too_old",
                f"The command was {age_s:.2f} s on its way; after {COMMAND_LIFE_S} s none is carried out.",
                "dead-man",
                {"age_s": round(age_s, 3), "limit_s": COMMAND_LIFE_S},
            )
        self._drive = self._shaped(drive, now_s)
        self._dies_s = now_s + COMMAND_LIFE_S - age_s
        return None

    def current(self, now_s: float) -> Drive | None:
        """The command that holds now, None when the last has died."""
        return self._drive if now_s < self._dies_s else None

    def owe(self, code: str, reason: str) -> None:
        """Nothing moves before this stick was in the middle. The first reason is the one that is told."""
        if self.owes is None:
            self.owes = NeutralNeeded(code, reason.rstrip("."))

    def _shaped(self, drive: Drive, now_s: float) -> Drive:
        """The command with what the steps make of its position: once for each, whatever the ticks."""
        position = StickPosition(drive.x, drive.y, drive.w)
        position, self._memory = apply_filters(self._steps, self._memory, position, now_s - self._taken_s)
        self._taken_s = now_s
        return replace(drive, x=position.x, y=position.y, w=position.w)


def velocity_of(drive: Drive, limits: Limits, max_share: float, reverse_steering: str) -> Velocity:
    """The twist a stick position asks for.

    The share scales the forward, lateral and turning limits; reverse is as fast as that allows,
    up to the robot's own reverse limit. With "car" steering the turn is mirrored in reverse.
    """
    share = min(drive.share, max_share)
    forward = limits.forward_mps * share
    vx = drive.x * (forward if drive.x >= 0 else min(forward, limits.reverse_mps))
    w = drive.w * limits.turn_radps * share
    if drive.x < 0 and reverse_steering == "car":
        w = -w
    velocity = Velocity(vx, drive.y * limits.lateral_mps * share, w)
    return STILL if velocity == STILL else velocity


def stick_of(velocity: Velocity, limits: Limits, max_share: float, reverse_steering: str) -> StickPosition:
    """The stick position that asks for `velocity` at share 1, or for as much of it as is allowed."""
    forward = limits.forward_mps * max_share
    x = _axis(velocity.vx, forward if velocity.vx >= 0 else min(forward, limits.reverse_mps))
    y = _axis(velocity.vy, limits.lateral_mps * max_share)
    w = _axis(velocity.w, limits.turn_radps * max_share)
    return StickPosition(x, y, -w if x < 0 and reverse_steering == "car" else w)


def _axis(speed: float, full: float) -> float:
    return min(max(speed / full, -1.0), 1.0) if full > 0.0 else 0.0
