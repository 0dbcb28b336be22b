"""Log sentences in the administrator's words."""

from __future__ import annotations

import logging


def unknown_host(record: logging.LogRecord) -> bool:
    """A filter: one line for a request under a name that is not in `FLEET_HOSTS`; anybody can cause many."""
    record.msg = record.getMessage().replace("ALLOWED_HOSTS", "FLEET_HOSTS")
    record.args = None
    record.exc_info = None
    return True
