"""What makes the audit log append-only in the database itself.

Against mistakes and against an application that was broken into; somebody who may drop triggers can still change the
past, which the chain then shows. docs/deployment.md says what to grant the application's role on PostgreSQL.

Records go only up to a checkpoint that their own chain has recorded later. Contents are put in and taken out, never
changed.
"""

from __future__ import annotations

from django.db.backends.base.base import BaseDatabaseWrapper

APPEND_ONLY = "is append-only"  # in the words of every refusal

# SQLite: name of the trigger: (when, condition). INSERT OR REPLACE deletes rows without asking triggers of DELETE.
_SQLITE = {
    "audit_record_no_update": ("BEFORE UPDATE ON audit_record", "1"),
    "audit_record_no_delete": (
        "BEFORE DELETE ON audit_record",
        """
        NOT EXISTS (
            SELECT 1 FROM audit_record AS later
            WHERE later.kind = 'audit.checkpoint' AND later.robot_id IS OLD.robot_id
            AND json_extract(later.parameters, '$.through') BETWEEN OLD.seq AND later.seq - 1
        )
        """,
    ),
    "audit_record_no_replace": (
        "BEFORE INSERT ON audit_record",
        """
        EXISTS (SELECT 1 FROM audit_record WHERE id = NEW.id)
        OR EXISTS (SELECT 1 FROM audit_record WHERE robot_id = NEW.robot_id AND seq = NEW.seq)
        OR NEW.robot_id IS NULL
        AND EXISTS (SELECT 1 FROM audit_record WHERE robot_id IS NULL AND seq = NEW.seq)
        """,
    ),
    "audit_content_no_update": ("BEFORE UPDATE ON audit_content", "1"),
    "audit_content_no_replace": (
        "BEFORE INSERT ON audit_content",
        "EXISTS (SELECT 1 FROM audit_content WHERE record_id = NEW.record_id)",
    ),
    "audit_actor_no_delete": ("BEFORE DELETE ON audit_actor", "1"),
    "audit_actor_no_update": (
        "BEFORE UPDATE ON audit_actor",
        "NEW.id <> OLD.id OR OLD.erased_at IS NOT NULL",
    ),
    "audit_actor_no_replace": (
        "BEFORE INSERT ON audit_actor",
        "EXISTS (SELECT 1 FROM audit_actor WHERE id = NEW.id)",
    ),
    "audit_chain_no_delete": ("BEFORE DELETE ON audit_chain", "1"),
    "audit_chain_no_update": ("BEFORE UPDATE ON audit_chain", "NEW.id <> OLD.id"),
}

# PostgreSQL: name of the trigger: (when, condition).
_POSTGRESQL = {
    "audit_record_no_update": ("BEFORE UPDATE ON audit_record FOR EACH ROW", ""),
    "audit_record_no_truncate": ("BEFORE TRUNCATE ON audit_record FOR EACH STATEMENT", ""),
    "audit_content_no_update": ("BEFORE UPDATE ON audit_content FOR EACH ROW", ""),
    "audit_content_no_truncate": ("BEFORE TRUNCATE ON audit_content FOR EACH STATEMENT", ""),
    "audit_actor_no_delete": ("BEFORE DELETE ON audit_actor FOR EACH ROW", ""),
    "audit_actor_no_truncate": ("BEFORE TRUNCATE ON audit_actor FOR EACH STATEMENT", ""),
    "audit_actor_no_update": (
        "BEFORE UPDATE ON audit_actor FOR EACH ROW",
        "WHEN (NEW.id <> OLD.id OR OLD.erased_at IS NOT NULL)",
    ),
    "audit_chain_no_delete": ("BEFORE DELETE ON audit_chain FOR EACH ROW", ""),
    "audit_chain_no_truncate": ("BEFORE TRUNCATE ON audit_chain FOR EACH STATEMENT", ""),
    "audit_chain_no_update": ("BEFORE UPDATE ON audit_chain FOR EACH ROW", "WHEN (NEW.id <> OLD.id)"),
}

_POSTGRESQL_FUNCTIONS = [
    f"""
    CREATE FUNCTION audit_refuse() RETURNS trigger LANGUAGE plpgsql AS $$
    BEGIN RAISE EXCEPTION '% {APPEND_ONLY}', TG_TABLE_NAME USING ERRCODE = 'integrity_constraint_violation'; END $$
    """,
    """
    CREATE FUNCTION audit_record_refuse_delete() RETURNS trigger LANGUAGE plpgsql AS $$
    BEGIN
        IF NOT EXISTS (
            SELECT 1 FROM audit_record AS later
            WHERE later.kind = 'audit.checkpoint' AND later.robot_id IS NOT DISTINCT FROM OLD.robot_id
            AND (later.parameters->>'through')::bigint BETWEEN OLD.seq AND later.seq - 1
        ) THEN
            RAISE EXCEPTION 'audit_record is append-only' USING ERRCODE = 'integrity_constraint_violation';
        END IF;
        RETURN OLD;
    END $$
    """,
    """
    CREATE TRIGGER audit_record_no_delete BEFORE DELETE ON audit_record
    FOR EACH ROW EXECUTE FUNCTION audit_record_refuse_delete()
    """,
]

NAMES = {"sqlite": set(_SQLITE), "postgresql": {*_POSTGRESQL, "audit_record_no_delete"}}

# The texts are searched by any three characters in a row (trigrams); shorter words by looking at every text.
_SQLITE_SEARCH = [
    """
    CREATE VIRTUAL TABLE audit_content_search USING fts5(
        text, content='audit_content', content_rowid='record_id', tokenize='trigram'
    )
    """,
    """
    CREATE TRIGGER audit_content_index AFTER INSERT ON audit_content WHEN NEW.text <> ''
    BEGIN INSERT INTO audit_content_search (rowid, text) VALUES (NEW.record_id, NEW.text); END
    """,
    """
    CREATE TRIGGER audit_content_unindex AFTER DELETE ON audit_content WHEN OLD.text <> ''
    BEGIN
        INSERT INTO audit_content_search (audit_content_search, rowid, text)
        VALUES ('delete', OLD.record_id, OLD.text);
    END
    """,
]
_POSTGRESQL_SEARCH = [
    "CREATE EXTENSION IF NOT EXISTS pg_trgm",
    "CREATE INDEX audit_content_trigrams ON audit_content USING gin (text gin_trgm_ops)",
]

CREATE = {
    "sqlite": [
        *(
            f"CREATE TRIGGER {name} {when} WHEN {condition}"
            f" BEGIN SELECT RAISE(ABORT, '{when.split()[-1]} {APPEND_ONLY}'); END"
            for name, (when, condition) in _SQLITE.items()
        ),
        *_SQLITE_SEARCH,
    ],
    "postgresql": [
        *_POSTGRESQL_FUNCTIONS,
        *(
            f"CREATE TRIGGER {name} {when} {condition} EXECUTE FUNCTION audit_refuse()"
            for name, (when, condition) in _POSTGRESQL.items()
        ),
        *_POSTGRESQL_SEARCH,
    ],
}


def missing(connection: BaseDatabaseWrapper) -> set[str]:
    """The names of those triggers that refuse, and are not there."""
    queries = {
        "sqlite": "SELECT name FROM sqlite_master WHERE type = 'trigger'",
        "postgresql": "SELECT tgname FROM pg_trigger WHERE tgenabled <> 'D'",
    }
    with connection.cursor() as cursor:
        cursor.execute(queries[connection.vendor])
        return NAMES[connection.vendor] - {name for (name,) in cursor.fetchall()}
