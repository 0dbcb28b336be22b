"""The watchdog's decisions: presses and heartbeats in, "publish zeros? cancel goals?" out. Pure; time is an argument.

The watchdog owns a stop until a bridge has taken it. From then on it follows the latch in the bridge's heartbeats, so
that a clear needs no watchdog. When the bridge dies with a latched stop, the watchdog owns the stop again and reports
it to the next bridge.
"""

from __future__ import annotations

from uuid import UUID

from msgspec import Struct, structs

SILENT_S = 0.15  # three beats of the bridge: it is dead, frozen, or its loop is held up
QUIET_AFTER_S = 1.0  # zeros are repeated this long for a robot that was driven and is not stopped


class Heartbeat(Struct, frozen=True, tag_field="t", tag="beat"):
    """Bridge to watchdog, with each tick: what the bridge does now."""

    publishing: bool = False  # twists reach the robot: for control, a stop, or the moment after
    latched: bool = False  # its stop, `by` whom and for what `reason`
    by: str = ""
    reason: str = ""
    heard: int = 0  # number of the `StopPress` that was latched there and written to its state file last
    drive: str = ""  # the topic in use


class StopPress(Struct, frozen=True, tag_field="t", tag="press"):
    """Watchdog to bridge: a stop that the watchdog heard. No two have one number, also not of two watchdogs."""

    number: int
    by: str
    reason: str = ""
    press: UUID | None = None  # as in `wire.LinkStop`
    at_s: float | None = None  # of this computer's monotonic clock: when it was heard


class StopRules:
    """One robot's latch. Presses are numbered from `first` on.

    `kept` is a stop that no bridge has taken yet, `before` what the last bridge did as far as its state file tells.
    """

    def __init__(self, first: int, kept: StopPress | None = None, before: Heartbeat | None = None) -> None:
        self._number = max(first, kept.number if kept else 0)
        self._own = kept
        self._beat = before or Heartbeat()
        self._beat_s = float("-inf")
        self._bridge_lives = False

    @property
    def own(self) -> StopPress | None:
        """The newest stop that no bridge has taken yet."""
        return self._own

    @property
    def latched(self) -> bool:
        """Whether the robot is stopped."""
        return self._own is not None or self._beat.latched

    @property
    def drive(self) -> str:
        """The drive topic that the bridge used last; empty: none was told."""
        return self._beat.drive

    def press(self, by: str, reason: str, press: UUID | None = None, at_s: float | None = None) -> StopPress:
        """Somebody stops the robot. Returns what the bridge must be told."""
        self._number += 1
        self._own = StopPress(self._number, by, reason, press, at_s)
        return self._own

    def bridge_came(self, now_s: float) -> None:
        """A bridge connected; its first beat follows."""
        self._bridge_lives = True
        self._beat_s = now_s

    def bridge_gone(self, now_s: float) -> None:
        """The bridge ended, whatever it had latched stays latched here."""
        self._bridge_lives = False
        self._beat_s = min(self._beat_s, now_s - SILENT_S)
        if self._beat.latched and self._own is None:
            self.press(self._beat.by, self._beat.reason)
        self._beat = structs.replace(self._beat, latched=False)

    def beat(self, beat: Heartbeat, now_s: float) -> StopPress | None:
        """The bridge lives. Returns a stop that it must still be told."""
        self._beat, self._beat_s = beat, now_s
        if self._own is not None and beat.heard == self._own.number:
            self._own = None
        return self._own

    def zeros(self, now_s: float) -> bool:
        """Whether to publish zeros: while a stop is latched, and for a moment after a driving bridge fell silent."""
        silent_s = now_s - self._beat_s - SILENT_S
        return self.latched or (self._beat.publishing and 0.0 <= silent_s < QUIET_AFTER_S)

    def cancel(self, now_s: float) -> bool:
        """Whether goals must be cancelled from here, since no bridge that reaches the robot does it."""
        works = self._bridge_lives and self._beat.publishing and now_s - self._beat_s < SILENT_S
        return self.latched and (self._own is not None or not works)
