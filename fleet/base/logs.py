"""Log messages: names that the administrator knows, no secrets, and one line for each request that is refused."""

from __future__ import annotations

import json
import logging
import os
import re
import sys
from datetime import UTC, datetime
from typing import TextIO

# Secrets by the text before them: in addresses (also mistyped ones, which are not found), of programs and webhooks, in
# headers and queries.
_SECRETS = re.compile(
    r"(?i)(/(?:join|welcome|bookings/+(?:ical|hand/+link)|accounts/+email)/+|/accounts/+password/+new/+[0-9a-z]+-"
    r"|\bfleet_(?=[\w-]{30})|\bwhsec_|\bBearer |\b(?:fleet_session\w*|\w*csrf\w*|token|code|key|state|ticket)="
    r"|ticket%3D)"
    r"([^\s/?&;\"'<>]{5,})"
)
# Level -> priority of syslog.
_PRIORITIES = (
    (logging.CRITICAL, 2),
    (logging.ERROR, 3),
    (logging.WARNING, 4),
    (logging.INFO, 6),
    (logging.NOTSET, 7),
)
LINE = "{asctime} {levelname} {name}: {message}"
_KEPT = 4  # characters of a secret, by which an administrator recognises it


class Redacted(logging.Formatter):
    """Writes lines, also tracebacks, in which secrets are cut to their first characters."""

    def format(self, record: logging.LogRecord) -> str:
        return for_journal(redacted(super().format(record)), record.levelno, sys.stderr)


class Json(logging.Formatter):
    """Writes each record as one line of JSON, with secrets cut."""

    def format(self, record: logging.LogRecord) -> str:
        line = {
            "at": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname,
            "logger": record.name,
            "process": record.process,
            "text": redacted(record.getMessage()),
        }
        if request := getattr(record, "request_id", None):
            line["request"] = request
        if record.exc_info:
            line["trace"] = redacted(self.formatException(record.exc_info))
        # In ASCII: some letters, such as U+2028, end a line for some readers
        return for_journal(json.dumps(line), record.levelno, sys.stderr)


def begin(as_json: bool) -> None:
    """Log to stderr, in a process without Django, as its settings do."""
    handler = logging.StreamHandler()
    handler.setFormatter(Json() if as_json else Redacted(LINE, style="{"))
    logging.basicConfig(level=logging.INFO, handlers=[handler])
    logging.getLogger("websockets").setLevel(logging.WARNING)


def for_journal(text: str, level: int, stream: TextIO) -> str:
    """Put the priority before each line if the stream leads to systemd's journal; else return the text as it is."""
    if not _is_journal(stream):
        return text
    prefix = f"<{next(priority for least, priority in _PRIORITIES if level >= least)}>"
    return "\n".join(prefix + line for line in text.splitlines())


def _is_journal(stream: TextIO) -> bool:
    """Return whether systemd's JOURNAL_STREAM names the stream: a child's output may lead elsewhere."""
    if not (named := os.environ.get("JOURNAL_STREAM")):
        return False
    try:
        facts = os.fstat(stream.fileno())
    except (OSError, ValueError):
        return False
    return named == f"{facts.st_dev}:{facts.st_ino}"


def redacted(text: str) -> str:
    """Return the text with each secret cut to its first characters."""
    return _SECRETS.sub(lambda found: f"{found[1]}{found[2][:_KEPT]}…", text)


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
    if chosen := getattr(getattr(record, "request", None), "META", {}).get("fleet.request_id"):
        record.msg = f"{record.msg} [request {chosen}]"
        record.request_id = chosen
    return True
