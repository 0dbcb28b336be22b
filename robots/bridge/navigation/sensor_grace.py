"""Hold the base for a short time while sensors are silent, before the drive to a place ends."""

from __future__ import annotations

import math

# Faults that may end soon, while older sensor data is still valid. A busy computer or radio link causes them.
MAY_PASS = frozenset({"odometry_stale", "scan_stale", "scan_unpaired"})
WAITS_S = 0.75  # longest sum of holds; the sum starts again after `WELL_S` without a fault
WELL_S = 2.0
SETTLES_S = 0.1  # a hold ends this long after the last fault: in a burst of late messages, the first are old


class SensorGrace:
    """The hold for one fault, or for several faults that follow each other closely."""

    def __init__(self) -> None:
        self.holds = False
        self._held_s = 0.0
        self._fault_s = -math.inf  # when a fault was last noted

    def note_fault(self, now_s: float) -> bool:
        """Note a fault and hold the base. Return False if the base has been held for too long."""
        if self.holds:
            self._held_s += now_s - self._fault_s
        elif now_s - self._fault_s > WELL_S:
            self._held_s = 0.0
        self.holds, self._fault_s = True, now_s
        return self._held_s <= WAITS_S

    def note_no_fault(self, now_s: float) -> None:
        """Note that no sensor is silent. The hold ends `SETTLES_S` after the last fault."""
        if self.holds and now_s - self._fault_s >= SETTLES_S:
            self._held_s += now_s - self._fault_s
            self.holds = False
