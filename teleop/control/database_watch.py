"""Whether the database was away a moment ago: then silence is no sign that a holder's page is gone."""

from __future__ import annotations

import time
from datetime import datetime

from teleop.control import lease_checks
from teleop.control.lease_checks import LeaseState

# Regular reads come every 2 s, and store the pages. After a shorter gap, `GRACE_S` leaves time for that.
GAP_S = 4.0


class DatabaseWatch:
    """The gaps between the answers that one process got to its regular reads.

    While the database is away, no process can store that its holder's page is there. After a gap,
    `GRACE_S` begins anew.
    """

    def __init__(self) -> None:
        self._answered_s = time.monotonic()
        self._since_s = float("-inf")

    def answered(self) -> None:
        """Note that the database has answered just now."""
        now_s = time.monotonic()
        if now_s - self._answered_s > GAP_S:
            self._since_s = now_s
        self._answered_s = now_s

    @property
    def was_away(self) -> bool:
        """Return whether the database was away within `GRACE_S`."""
        return time.monotonic() - self._since_s < lease_checks.GRACE_S

    def excuses(self, lease: LeaseState | None, now: datetime) -> bool:
        """Return whether the holder's page may seem to be away only because the database was."""
        return self.was_away and lease is not None and lease_checks.lapse_reason(lease, now) == "away"
