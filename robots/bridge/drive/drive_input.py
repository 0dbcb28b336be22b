"""Age and validity of stick commands, and the twist for a stick position. Pure."""

from __future__ import annotations

from collections.abc import Sequence

from msgspec.structs import replace

from robots.shared.configuration.gate_profile import Limits
from robots.shared.configuration.input_filters import (
    COMMAND_LIFE_S,
    Memory,
    StickPosition,
    StickStep,
    apply_filters,
)
from robots.shared.geometry.poses import STILL, Velocity
from robots.shared.sentences import Sentence, of_parts, say
from robots.shared.wire import Drive, NeutralNeeded, Refusal

_WINDOW_S = 30.0


class AgeEstimator:
    """Estimate the age of messages by the sender's monotonic clock. Its offset to our clock is unknown.

    The smallest (arrival - sent) is the offset plus the shortest delay. The age of a message is its delay
    beyond this minimum. The minimum covers the last 30 to 60 s, because clocks drift and a network's delay
    may change.
    """

    def __init__(self) -> None:
        self._best = [float("inf"), float("inf")]  # of the previous window, of this window
        self._window_ends_s = float("-inf")

    def age_s(self, sent_s: float, now_s: float) -> float:
        """Return the age of this message: how much longer it took than the fastest message, in seconds."""
        if now_s >= self._window_ends_s:
            self._best = [self._best[1], float("inf")]
            self._window_ends_s = now_s + _WINDOW_S
        offset_s = now_s - sent_s
        self._best[1] = min(self._best[1], offset_s)
        return offset_s - min(self._best)


class DriveInput:
    """The newest command of one source (a page, or its holder's programs), after the input filters `steps`.

    A command is valid for `COMMAND_LIFE_S` after the earliest time at which it can have been sent. If
    anything except the operator stopped the robot, the stick must return to the middle before the robot moves
    again (`neutral_needed`).
    """

    def __init__(self, steps: Sequence[StickStep] = ()) -> None:
        self._steps = steps
        self._memory: Memory | None = None
        self.taken_s = float("-inf")  # time of the last accepted command
        self._age = AgeEstimator()
        self._drive: Drive | None = None
        self._dies_s = float("-inf")
        self.neutral_needed: NeutralNeeded | None = None
        self.is_out = False  # the last command asked for motion; kept after the command has expired

    @property
    def seq(self) -> int | None:
        """Number of the last accepted command."""
        return self._drive.seq if self._drive else None

    def accept(self, drive: Drive, now_s: float) -> Refusal | None:
        """Make `drive` the newest command, or return why it is refused."""
        if self._drive and drive.seq <= self._drive.seq:
            return Refusal(
                "out_of_order",
                say(
                    "Command {seq} came after {newest} and was dropped.",
                    seq=drive.seq,
                    newest=self._drive.seq,
                ),
                "dead-man",
                {"seq": drive.seq, "newest_seq": self._drive.seq},
            )
        age_s = self._age.age_s(drive.sent_ms / 1000.0, now_s)
        if age_s > COMMAND_LIFE_S:
            return Refusal(
                "too_old",
                say(
                    "The command was {age:.2f} s on its way; commands older than {limit} s are refused.",
                    age=age_s,
                    limit=COMMAND_LIFE_S,
                ),
                "dead-man",
                {"age_s": round(age_s, 3), "limit_s": COMMAND_LIFE_S},
            )
        self._drive = self._filtered(drive, now_s)
        self._dies_s = now_s + COMMAND_LIFE_S - age_s
        return None

    def current(self, now_s: float) -> Drive | None:
        """Return the valid command; None if the last one has expired."""
        return self._drive if now_s < self._dies_s else None

    def require_neutral(self, code: str, reason: str) -> None:
        """Require a stick in the middle before the robot moves. Only the first reason is reported."""
        if self.neutral_needed is None:  # a verdict's text says itself that it stopped the robot
            self.neutral_needed = NeutralNeeded(code, _bare(reason))

    def _filtered(self, drive: Drive, now_s: float) -> Drive:
        """Return the command with its position filtered.

        Each command passes the filters once, however often the core ticks.
        """
        position = StickPosition(drive.x, drive.y, drive.w)
        position, self._memory = apply_filters(self._steps, self._memory, position, now_s - self.taken_s)
        self.taken_s = now_s
        return replace(drive, x=position.x, y=position.y, w=position.w)


def velocity_of(drive: Drive, limits: Limits, max_share: float, reverse_steering: str) -> Velocity:
    """Return the twist for a stick position.

    The share scales the limits of forward, lateral and turning speed. The reverse limit is the scaled forward
    limit, but at most the robot's reverse limit. With "car" steering the turn is mirrored in reverse.
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
    """Return the stick position for `velocity` at share 1. A speed above its limit becomes a full stick."""
    forward = limits.forward_mps * max_share
    x = _axis(velocity.vx, forward if velocity.vx >= 0 else min(forward, limits.reverse_mps))
    y = _axis(velocity.vy, limits.lateral_mps * max_share)
    w = _axis(velocity.w, limits.turn_radps * max_share)
    return StickPosition(x, y, -w if x < 0 and reverse_steering == "car" else w)


def _axis(speed: float, full: float) -> float:
    return min(max(speed / full, -1.0), 1.0) if full > 0.0 else 0.0


def _bare(reason: str) -> str:
    """Return a reason as part of another sentence."""
    text = reason.removeprefix("stopped: ")
    if not isinstance(reason, Sentence):
        return text.rstrip(".")
    key, *rest = reason.parts
    return say("{reason:bare}", reason=of_parts(text, [key.removeprefix("stopped: "), *rest]))
