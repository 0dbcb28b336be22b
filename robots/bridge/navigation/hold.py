"""After a goal has ended: hold the base until navigation is quiet.

Navigation may confirm a cancel and still drive on. While it sends velocities, or the base moves, the bridge
sends on its own drive topic, which has priority: zeros, or the operator's twists. Navigation may also pause
and then drive on. So the bridge watches it for some minutes after our goal, and holds the base again if
navigation drives without a goal. Other nodes may use navigation's topic without a goal, so a second hold does
not extend these minutes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Future

from robots.bridge.audit.records import Records
from robots.bridge.watchdog.rules import CANCEL_AGAIN_S
from robots.shared.sentences import say

QUIET_S = 1.0  # the hold ends after this time at standstill without a velocity from navigation
WATCHED_S = 300.0  # navigation is watched this long after a goal, or after its hold
RUNS_ON_S = 30.0  # people are informed if navigation still reports a goal this long after its end
GOES_ON_S = 1.5  # navigation that still drives this long after a cancel does not obey
UNENDED = say("The robot’s navigation still reports a goal that was ended: the bridge holds the base.")
UNHEARD = say("The robot’s navigation still drives although its goal has ended: the bridge holds the base.")


class Hold:
    """One hold at a time."""

    def __init__(self, records: Records, cancel: Callable[[str], None], watched: str = "") -> None:
        """`watched`: a goal of an earlier bridge, to which navigation may still drive."""
        self._records = records
        self._cancel = cancel
        self.goal_id: str | None = None  # the goal that has ended; None: no hold
        self.watched = watched  # the last goal, until `WATCHED_S` after its end
        self._ended_s: float | None = None  # when `watched` or its hold ended; None: the first tick sets it
        self._is_again = False  # navigation drives again, without a goal
        self._since_s = -math.inf
        self._drove_s = -math.inf  # when navigation last sent a velocity that is not zero
        self._moved_s = -math.inf  # when the base last moved, or its motion was unknown
        self._cancelled_s = -math.inf
        self._record: Future[int] | None = None
        self.why = ""  # for people, when navigation does not obey

    @property
    def is_disobeyed(self) -> bool:
        """Return whether navigation still drives although its goal has ended."""
        return self.why == UNHEARD

    @property
    def holds(self) -> bool:
        """Return whether the bridge holds the base."""
        return self.goal_id is not None

    def begin(self, goal_id: str, now_s: float) -> None:
        """Hold the base from now on: this goal has ended, or is cancelled."""
        self._hold(goal_id, now_s)
        self.watched, self._ended_s, self._is_again = goal_id, now_s, False

    def _hold(self, goal_id: str, now_s: float) -> None:
        if self.goal_id is None:
            self._since_s = now_s
        self.goal_id, self._moved_s, self._cancelled_s = goal_id, now_s, now_s

    def drop(self) -> None:
        """End the hold: navigation drives to a new goal."""
        self.goal_id = None

    def drove(self, moves: bool, has_goal: bool, now_s: float) -> None:
        """Take a velocity of navigation. Hold the base again if navigation now drives without a goal."""
        if not moves:
            return
        self._drove_s = now_s
        if self.watched and not self.holds and not has_goal:
            self._hold(self.watched, now_s)
            self._is_again = True

    def tick(self, still: bool | None, others_drive: bool, runs_on: bool, now_s: float) -> None:
        """Repeat the cancel while navigation does not obey. End the hold when it is no longer needed.

        It is not needed when navigation is quiet, or when others use navigation and nobody has control
        (`others_drive`). `runs_on`: navigation has not confirmed the end of the goal. It may pause, and drive
        on later.
        """
        if self._ended_s is None or (self.holds and not self._is_again):
            self._ended_s = now_s
        elif not self.holds and now_s - self._ended_s > WATCHED_S:
            self.watched = ""
        if self.goal_id is None:
            return
        if still is not True:
            self._moved_s = now_s
        drives = self._drove_s > self._since_s and now_s - self._drove_s < QUIET_S
        is_quiet = not drives and now_s - max(self._moved_s, self._since_s) >= QUIET_S
        is_over = self._is_again and now_s - self._since_s > WATCHED_S
        if others_drive or ((is_quiet or is_over) and not runs_on):
            self._end("released", now_s)
            if is_over:
                self.watched = ""
            return
        if drives and now_s - self._since_s > GOES_ON_S:
            self._tell(self.goal_id, UNHEARD, now_s)
        elif not self.why and runs_on and now_s - self._since_s > RUNS_ON_S:
            self._tell(self.goal_id, UNENDED, now_s)
        if self.why and now_s - self._cancelled_s >= CANCEL_AGAIN_S:
            self._cancelled_s = now_s
            self._cancel(self.goal_id)

    def _tell(self, goal_id: str, why: str, now_s: float) -> None:
        """Show why the base is held for so long, and record it once."""
        is_told, self.why = bool(self.why), why
        if is_told:
            return
        what = {"goal": goal_id, "text": str(why)}
        self._record = self._records.own("go.hold", what, now_s)

    def _end(self, outcome: str, now_s: float) -> None:
        record, self._record = self._record, None
        self.goal_id, self.why = None, ""
        if record is not None:
            self._records.own_outcome(record, "go.hold", outcome, {}, now_s)
