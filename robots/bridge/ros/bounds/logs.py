"""Limits rospy's log lines, because any host can cause them: few a second, and short."""

from __future__ import annotations

import logging
import time

from robots.shared.link.flood_limits import TokenBucket
from robots.shared.texts import cut

TALKATIVE = ("rospy", "rosout", "xmlrpc", "rosgraph", "genpy")
PER_S, BURST = 2.0, 50.0
LONGEST = 4000  # characters


class LogLimiter(logging.Filter):
    """Filter for handlers: passes other loggers' records unchanged, and a few of rospy's per second."""

    def __init__(self) -> None:
        super().__init__()
        self._budget = TokenBucket(PER_S, BURST)

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether the record is written."""
        if record.name.partition(".")[0] not in TALKATIVE:
            return True
        if not self._budget.spend(time.monotonic()):
            return False
        record.msg, record.args = cut(record.getMessage(), LONGEST), ()
        return True


def spare_the_log() -> None:
    """Add the filter to all present handlers."""
    sparing = LogLimiter()
    for handler in logging.getLogger().handlers:
        handler.addFilter(sparing)
