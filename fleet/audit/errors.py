"""Errors of the audit log, most of them from the database."""

from __future__ import annotations

from math import ceil
from typing import Final

from fleet.base.database.schema import SchemaRefused
from robots.shared.sentences import say

# Instead of words, because those of the error name migrations.
OTHER_RELEASE = SchemaRefused.__name__  # messages are compared in small letters: only this error has it
# Words in error messages of SQLite and PostgreSQL, with a code and a cause for people. The first match
# counts.
CAUSES = [
    ("locked", "locked", say("another process keeps the database locked")),
    ("lock timeout", "locked", say("another process keeps the database locked")),
    ("statement timeout", "slow", say("the database took too long")),
    ("full", "disk_full", say("the disk of the database is full")),
    ("no space left", "disk_full", say("the disk of the database is full")),
    ("readonly", "read_only", say("the database is read-only")),
    ("read-only", "read_only", say("the database is read-only")),
    ("no such table", "no_table", say("a table is missing: run manage.py migrate")),
    (
        OTHER_RELEASE,
        "other_release",
        say("the database belongs to another release; /healthz says what to do"),
    ),
]


class AuditUnavailable(Exception):
    """The audit log cannot be written, so the action must not be done.

    `code`, `text` and `rule` ("audit") are the parts of the refusal that the requester gets.
    """

    rule: Final = "audit"

    def __init__(self, code: str, text: str) -> None:
        super().__init__(text)
        self.code = code
        self.text = text

    @classmethod
    def because(cls, error: Exception) -> AuditUnavailable:
        """Return the refusal that explains a database error."""
        code, cause = cause_of(error)
        return cls(f"audit_{code}", say("Not done, because it could not be recorded: {cause}.", cause=cause))


class TooManyChanges(AuditUnavailable):
    """A person has made as many changes as one person may make in a period (`fleet.audit.rates`)."""

    def __init__(self, did: str, period: str, most: int, wait_s: float) -> None:
        text = say(
            "Not done: you have {did} within one {period}, the most for one person. "
            "Go on in {minutes} min, or ask the staff.",
            did=say(did, most=most),
            period=say(period),
            minutes=ceil(wait_s / 60),
        )
        super().__init__("too_many_changes", text)
        self.wait_s = max(1, ceil(wait_s))
        self.figures: dict[str, int | str] = {"most": most, "per": period, "wait_s": self.wait_s}


def cause_of(error: BaseException) -> tuple[str, str]:
    """Return the cause of a database error: a code for programs and a text for people."""
    said = OTHER_RELEASE if isinstance(error, SchemaRefused) else str(error).lower()
    return next(
        ((code, cause) for words, code, cause in CAUSES if words in said),
        ("unreachable", say("the database does not answer")),
    )


class AppendOnly(TypeError):
    """Somebody tried to change or delete a record."""

    def __init__(self) -> None:
        super().__init__(
            "Audit records are never changed or deleted; append a new one that refers to the old."
        )


class NotPlain(ValueError):
    """A value that cannot be kept as JSON."""

    def __init__(self, value: object) -> None:
        super().__init__(f"{value!r} cannot be recorded: it is no JSON value.")


class UnknownKind(ValueError):
    """A record of a kind that is not listed in `fleet.audit.kinds`."""

    def __init__(self, kind: str) -> None:
        super().__init__(f"{kind!r} is no kind of record: add it to fleet/audit/kinds.py.")
