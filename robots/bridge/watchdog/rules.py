"""Decides from stops and heartbeats whether to publish zeros and to cancel goals. Pure: time is an argument.

The watchdog owns a stop until a bridge has taken it. From then on the latch follows the bridge's heartbeats, so that
clearing works as without a watchdog. When a bridge dies with its stop latched, the watchdog owns the stop again and
sends it to the next bridge.
"""

from __future__ import annotations

from uuid import UUID

from msgspec import Struct, structs

from robots.shared.wire import MovesAlthoughStopped

SILENT_S = 0.15  # s, three heartbeats: the bridge is dead, frozen, or its loop is blocked
# s: a bridge that hangs for this time cannot watch navigation; zeros are sent from `SILENT_S` on
LOST_S = 1.0
CANCEL_AGAIN_S = 0.5  # repeat a cancel: the first one may not have reached the robot
# s: if the robot was driven and is not stopped, zeros are repeated for this time after the first that reached it. If
# none does, because the watchdog has just started or is not found yet, they end after the longer time.
QUIET_AFTER_S, REACHES_S = 1.0, 10.0


class Heartbeat(Struct, frozen=True, tag_field="t", tag="beat"):
    """Bridge to watchdog, with each tick: the bridge's present state."""

    publishing: bool = False  # twists are sent: during control, a stop, or shortly after
    listened: bool = True  # a node of the robot is known to get them
    latched: bool = False  # the bridge's stop is latched; `by` and `reason` belong to it
    by: str = ""
    reason: str = ""
    heard: int = 0  # number of the last `StopPress` that the bridge latched and wrote to its state file
    drive: str = ""  # the present drive topic
    drives_itself: bool = False  # the robot's navigation drives, and the bridge watches the drive
    moves_although_stopped: MovesAlthoughStopped | None = None


class StopPress(Struct, frozen=True, tag_field="t", tag="press"):
    """Watchdog to bridge: a stop that the watchdog received. Numbers are unique, also across restarts."""

    number: int
    by: str
    reason: str = ""
    press: UUID | None = None  # as in `wire.LinkStop`
    at_s: float | None = None  # when it was received, this computer's monotonic clock


class GoalsCancelled(Struct, frozen=True, tag_field="t", tag="goals_cancelled"):
    """Watchdog to bridge: all goals are cancelled, because the bridge was silent for `silent_s` in a drive."""

    silent_s: float


class StopRules:
    """One robot's latch. Presses are numbered from `first` on.

    `kept`: a stop that no bridge has taken yet. `before`: the last bridge's state, from its state file.
    """

    def __init__(self, first: int, kept: StopPress | None = None, before: Heartbeat | None = None) -> None:
        self._number = max(first, kept.number if kept else 0)
        self.own = kept  # the newest stop that no bridge has taken yet
        self._beat = before or Heartbeat()
        self._beat_s = float("-inf")
        self._reached_s = float("inf")  # when the first zero since then reached the robot
        self._bridge_lives = False

    @property
    def latched(self) -> bool:
        """Return whether the robot is stopped."""
        return self.own is not None or self._beat.latched

    def moves_although_stopped(self, now_s: float) -> MovesAlthoughStopped | None:
        """Return how the stopped robot moves, if a bridge has just seen it."""
        is_fresh = self._bridge_lives and now_s - self._beat_s < LOST_S
        return self._beat.moves_although_stopped if is_fresh else None

    def press(self, by: str, reason: str, press: UUID | None = None, at_s: float | None = None) -> StopPress:
        """Take a stop. Return the message for the bridge."""
        self._number += 1
        self.own = StopPress(self._number, by, reason, press, at_s)
        return self.own

    def bridge_came(self, now_s: float) -> None:
        """Note that a bridge connected; its first heartbeat follows."""
        self._bridge_lives = True
        self._beat_s = now_s

    def bridge_gone(self, now_s: float) -> None:
        """Note that the bridge ended. Its latched stop stays latched here."""
        self._bridge_lives = False
        self._beat_s = min(self._beat_s, now_s - SILENT_S)
        if self._beat.latched and self.own is None:
            self.press(self._beat.by, self._beat.reason)
        self._beat = structs.replace(self._beat, latched=False)

    def beat(self, beat: Heartbeat, now_s: float) -> StopPress | None:
        """Take a heartbeat. Return a stop that the bridge has not taken yet."""
        self._beat, self._beat_s, self._reached_s = beat, now_s, float("inf")
        if self.own is not None and beat.heard == self.own.number:
            self.own = None
        return self.own

    def zeros(self, now_s: float) -> bool:
        """Return whether to publish zeros: while a stop is latched, and after a driving bridge became silent.

        If a person drove, zeros are published for `QUIET_AFTER_S`; if navigation drove, until a bridge is
        back.
        """
        silent_s = self._beat_s + SILENT_S
        until_s = min(self._reached_s + QUIET_AFTER_S, silent_s + REACHES_S)
        driving = self._beat.publishing and silent_s <= now_s < until_s
        return self.latched or driving or self._unwatched(now_s)

    def reached(self, now_s: float) -> None:
        """Note that a zero reached the robot."""
        self._reached_s = min(self._reached_s, now_s)

    def _unwatched(self, now_s: float) -> bool:
        """Return whether navigation may drive the robot while no bridge watches it."""
        return self._beat.drives_itself and now_s - self._beat_s >= SILENT_S

    def cancel(self, now_s: float) -> bool:
        """Return whether the watchdog must cancel goals, because no bridge that reaches the robot does it."""
        reaches = self._beat.publishing and self._beat.listened
        works = self._bridge_lives and reaches and now_s - self._beat_s < SILENT_S
        lost = not self._bridge_lives or self.hung(now_s) is not None
        return (lost and self._unwatched(now_s)) or (self.latched and (self.own is not None or not works))

    def hung(self, now_s: float) -> GoalsCancelled | None:
        """Return the message for a bridge that hangs while navigation drives, and whose goals are cancelled."""
        silent_s = now_s - self._beat_s
        return GoalsCancelled(silent_s) if self._unwatched(now_s) and silent_s >= LOST_S else None
