"""rospy's log lines: only ours are written, few a second and short, because any host can cause them."""

from __future__ import annotations

import logging
import time

import rospy.core

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


def keep_our_log() -> None:
    """Let rospy log warnings and errors by our handlers. Its own set-up would read YAML, and write files."""
    rospy.core.configure_logging = lambda _name: None
    for name in ("rospy", "rosout", "xmlrpc"):
        logging.getLogger(name).setLevel(logging.WARNING)


def spare_the_log() -> None:
    """Add the filter to all present handlers."""
    sparing = LogLimiter()
    for handler in logging.getLogger().handlers:
        handler.addFilter(sparing)
