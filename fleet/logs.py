"""Log messages with the names that the administrator knows, and one line for each request that is refused."""

from __future__ import annotations

import logging


def one_line(record: logging.LogRecord) -> bool:
    """Shorten the log of a refused request to one line without traceback: anybody can send many of them.

    Faults of the console (status 500) keep their tracebacks.
    """
    if record.name.startswith("django.security") or (
        record.name == "django.request" and record.levelno < logging.ERROR
    ):
        text = record.getMessage().replace("ALLOWED_HOSTS", "FLEET_HOSTS")
        record.msg = "".join(one if one.isprintable() else ascii(one)[1:-1] for one in text)
        record.args = record.exc_info = record.exc_text = None
    return True
