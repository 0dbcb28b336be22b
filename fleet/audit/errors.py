"""What can go wrong with the audit log."""

from __future__ import annotations

# Words of SQLite's and PostgreSQL's messages, and what they mean for the reader. First match counts.
CAUSES = [
    ("locked", "audit_locked", "another process keeps the database locked"),
    ("lock timeout", "audit_locked", "another process keeps the database locked"),
    ("full", "audit_disk_full", "the disk of the database is full"),
    ("no space left", "audit_disk_full", "the disk of the database is full"),
    ("readonly", "audit_read_only", "the database is read-only"),
    ("read-only", "audit_read_only", "the database is read-only"),
    ("no such table", "audit_no_table", "its table is missing: run manage.py migrate"),
]


class AuditUnavailable(Exception):
    """The audit log cannot be written, so what was to be recorded must not be done.

    `code` and `text` are those of the refusal to answer with; its rule is "audit".
    """

    rule = "audit"

    def __init__(self, code: str, text: str) -> None:
        super().__init__(text)
        self.code = code
        self.text = text

    @classmethod
    def because(cls, error: Exception) -> AuditUnavailable:
        """The refusal that explains a database error."""
        said = str(error).lower()
        code, cause = next(
            ((code, cause) for words, code, cause in CAUSES if words in said),
            ("audit_unreachable", "the database does not answer"),
        )
        return cls(code, f"Not done, because it could not be recorded: {cause}.")


class AppendOnly(TypeError):
    """Somebody tried to change or delete a record."""

    def __init__(self) -> None:
        super().__init__(
            "Audit records are never changed or deleted; append a new one that refers to the old."
        )
