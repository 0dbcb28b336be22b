"""Errors of the database, and so of the audit log."""

from __future__ import annotations

from typing import Final

# Words of SQLite's and PostgreSQL's messages, and their meaning for the reader. First match counts.
CAUSES = [
    ("locked", "locked", "another process keeps the database locked"),
    ("lock timeout", "locked", "another process keeps the database locked"),
    ("statement timeout", "slow", "the database took too long"),
    ("full", "disk_full", "the disk of the database is full"),
    ("no space left", "disk_full", "the disk of the database is full"),
    ("readonly", "read_only", "the database is read-only"),
    ("read-only", "read_only", "the database is read-only"),
    ("no such table", "no_table", "a table is missing: run manage.py migrate"),
]


class AuditUnavailable(Exception):
    """The audit log cannot be written, so the action must not be done.

    `code` and `text` are those of the refusal to answer with; its rule is "audit".
    """

    rule: Final = "audit"

    def __init__(self, code: str, text: str) -> None:
        super().__init__(text)
        self.code = code
        self.text = text

    @classmethod
    def because(cls, error: Exception) -> AuditUnavailable:
        """The refusal that explains a database error."""
        code, cause = cause_of(error)
        return cls(f"audit_{code}", f"Not done, because it could not be recorded: {cause}.")


def cause_of(error: BaseException) -> tuple[str, str]:
    """A database error in a word for programs and in words for people."""
    said = str(error).lower()
    return next(
        ((code, cause) for words, code, cause in CAUSES if words in said),
        ("unreachable", "the database does not answer"),
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
    """A record of a kind that does not stand in `fleet.audit.kinds`."""

    def __init__(self, kind: str) -> None:
        super().__init__(f"{kind!r} is no kind of record: add it to fleet/audit/kinds.py.")
