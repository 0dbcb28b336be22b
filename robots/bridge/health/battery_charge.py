"""Read the charge from a robot's battery message. Pure."""

from __future__ import annotations

import math
from typing import Any

# a gauge that is not calibrated reports up to 1.1; below 2 percent, a battery is empty anyway
FULL_SHARE = 2.0


class BatteryCharge:
    """The charge by the messages of one topic: std_msgs/Float32 in percent, or sensor_msgs/BatteryState.

    A BatteryState has its charge as a share from 0 to 1. Some drivers send percent: from the first larger number on,
    the topic counts as such. Drivers that do not know the share send NaN or a negative number.
    """

    def __init__(self) -> None:
        self._in_percent = False

    def percent(self, message: Any) -> float | None:
        """Return the charge in percent; None: the message does not say it."""
        if not hasattr(message, "percentage"):
            return _known(message.data)
        if (sent := _known(message.percentage)) is not None:
            self._in_percent |= sent > FULL_SHARE
            return sent if self._in_percent else 100.0 * sent
        charge, capacity = _known(message.charge), _known(message.capacity)
        return 100.0 * charge / capacity if charge is not None and capacity else None


def _known(number: float) -> float | None:
    return float(number) if math.isfinite(number) and number >= 0.0 else None
