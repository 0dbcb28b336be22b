"""How long the base is held for sensors that are silent, before the drive to a place ends."""

from __future__ import annotations

import math

# Faults that may end within a moment while all that was seen is still known. A busy computer or radio causes them.
MAY_PASS = frozenset({"odometry_stale", "scan_stale", "scan_unpaired"})
WAITS_S = 0.75  # so long the base is held, in all, until the sensors have been well for `WELL_S`
WELL_S = 2.0
SETTLES_S = 0.1  # late messages come in a burst: the first of them are old


class SensorGrace:
    """Hold on through one fault, or through several that follow each other closely."""

    def __init__(self) -> None:
        self.holds = False
        self._held_s = 0.0
        self._fault_s = -math.inf  # when a fault was last noted

    def note_fault(self, now_s: float) -> bool:
        """Note a fault and hold the base; return False when it has been held for too long."""
        if self.holds:
            self._held_s += now_s - self._fault_s
        elif now_s - self._fault_s > WELL_S:
            self._held_s = 0.0
        self.holds, self._fault_s = True, now_s
        return self._held_s <= WAITS_S

    def settle(self, now_s: float) -> None:
        """Note that no sensor is silent: soon the base need not be held."""
        if self.holds and now_s - self._fault_s >= SETTLES_S:
            self._held_s += now_s - self._fault_s
            self.holds = False
