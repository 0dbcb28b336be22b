"""Log messages with the names that the administrator knows."""

from __future__ import annotations

import logging


def unknown_host(record: logging.LogRecord) -> bool:
    """Shorten the log of a request to a host that is not in `FLEET_HOSTS` to one line without traceback.

    Anybody can send many such requests.
    """
    record.msg = record.getMessage().replace("ALLOWED_HOSTS", "FLEET_HOSTS")
    record.args = None
    record.exc_info = None
    return True
