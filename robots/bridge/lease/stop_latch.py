"""The stop latch: presses, number and state of the stop, time to standstill. Pure: time is an argument."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from uuid import UUID

from msgspec import structs

from robots.bridge.lease.state_store import SavedState
from robots.shared.sentences import say
from robots.shared.wire import Refusal, StopState

PRESSES_KNOWN = 1000  # number of stored presses; a press that is delivered twice arrives again within seconds
# A press time of the watchdog that is older may belong to an earlier boot of this computer: it is not used.
PRESS_KEPT_S = 60.0


class StopLatch:
    """One robot's emergency stop. Stops are numbered from `stops_before` on; each press counts as one stop."""

    def __init__(self, saved: SavedState, stops_before: int) -> None:
        self.state = StopState("clear", number=stops_before)
        if saved.latched:  # nobody has yet measured whether the robot stands still
            self.state = StopState("stopping", saved.by or None, saved.reason, number=stops_before)
        self._latched_s: float | None = None  # None: before this process started
        self._pressed_s: float | None = None  # time of the press; None: unknown
        self._first: UUID | None = None  # the first press of this stop
        self._handled: deque[UUID] = deque(maxlen=PRESSES_KNOWN)  # these presses do not stop the robot again

    @property
    def latched(self) -> bool:
        """Return whether the robot is stopped."""
        return self.state.state != "clear"

    def was_handled(self, press: UUID | None) -> bool:
        """Return whether this press arrived before. A press without an id (None) is always new."""
        return press in self._handled

    def is_stopped_by(self, by: str, reason: str) -> bool:
        """Return whether the present stop has this name and reason."""
        return self.latched and (self.state.by or "", self.state.reason) == (by, reason)

    def press(
        self, by: str, reason: str, now_s: float, press: UUID | None, *, stands: bool, waited: bool
    ) -> None:
        """Latch the stop, or count another press of a latched stop.

        `stands`: the robot stands still. `waited`: the press was delivered late, so its time is unknown.
        """
        if press is not None:
            self.ignore([press])
        if not self.latched:
            self.state = StopState("stopping", number=self.state.number, was_standing=stands)
            self._latched_s = now_s
            self._pressed_s = None if waited else now_s
            self._first = press
        self.state = structs.replace(self.state, by=by, reason=reason, number=self.state.number + 1)

    def correct_time(self, press: UUID | None, pressed_s: float | None, now_s: float) -> None:
        """Set the time of the present stop's first press to `pressed_s`, instead of its time of arrival here.

        If `pressed_s` is None or cannot be right, the time is unknown.
        """
        heard_s = self._pressed_s
        if press != self._first or heard_s is None:
            return
        self._pressed_s = pressed_s if pressed_s and 0.0 <= now_s - pressed_s < PRESS_KEPT_S else None
        took_ms = self.state.standstill_ms
        if took_ms is not None:
            took_ms = None if self._pressed_s is None else took_ms + round((heard_s - self._pressed_s) * 1000)
            self.state = structs.replace(self.state, standstill_ms=took_ms)

    def ignore(self, presses: Sequence[UUID]) -> None:
        """Ignore these presses when they arrive."""
        self._handled.extend(presses)

    def clear(self, number: int, presses: Sequence[UUID]) -> Refusal | None:
        """Clear stop `number`. Return a refusal if somebody has pressed stop again.

        `presses` are older than this clear. They may arrive later and are then ignored.
        """
        stop = self.state
        if number != stop.number:
            text = (
                say(
                    "Stop was pressed again by {name}. Check the robot, then clear the new stop.",
                    name=stop.by,
                )
                if stop.by
                else say("Stop was pressed again. Check the robot, then clear the new stop.")
            )
            return Refusal("stopped_again", text, "stop", {"number": number, "newest": stop.number})
        self.state = StopState("clear", number=stop.number)
        self.ignore(presses)
        self._latched_s = self._pressed_s = self._first = None
        return None

    def observe(self, still: bool | None, seen_s: float) -> None:
        """Take odometry that arrived at `seen_s`. Standstill after the press ends the stopping phase."""
        if self.state.state != "stopping":
            return
        if still is False:
            self.state = structs.replace(self.state, was_standing=False)
        elif still and (self._latched_s is None or seen_s > self._latched_s):
            took_ms = None
            if self._pressed_s is not None and not self.state.was_standing:
                took_ms = round((seen_s - self._pressed_s) * 1000)
            self.state = structs.replace(self.state, state="stopped", standstill_ms=took_ms)
