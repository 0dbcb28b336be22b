"""Triggers that make the audit log append-only in the database itself, and the indexes of its texts.

They protect against mistakes and against an attacker who controls the application. An attacker who may drop
triggers can still change old records; the chain then shows the change. docs/deployment.md lists the rights of
the application's role on PostgreSQL.

Records can be deleted only up to a checkpoint that their own chain has recorded later. Contents are added and
removed, never changed. Verification compares the triggers in the database with this module: every change here
needs a migration.
"""

from __future__ import annotations

from typing import NamedTuple

from django.db.backends.base.base import BaseDatabaseWrapper

APPEND_ONLY = "is append-only"  # in the text of every refusal

# SQLite: name of the trigger: (when, condition). INSERT OR REPLACE deletes rows without DELETE triggers.
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

# PostgreSQL: functions by name.
_POSTGRESQL_FUNCTIONS = {
    "audit_refuse": f"""
    BEGIN RAISE EXCEPTION '% {APPEND_ONLY}', TG_TABLE_NAME USING ERRCODE = 'integrity_constraint_violation'; END
    """,
    "audit_record_refuse_delete": f"""
    BEGIN
        IF NOT EXISTS (
            SELECT 1 FROM audit_record AS later
            WHERE later.kind = 'audit.checkpoint' AND later.robot_id IS NOT DISTINCT FROM OLD.robot_id
            AND (later.parameters->>'through')::bigint BETWEEN OLD.seq AND later.seq - 1
        ) THEN
            RAISE EXCEPTION 'audit_record {APPEND_ONLY}' USING ERRCODE = 'integrity_constraint_violation';
        END IF;
        RETURN OLD;
    END
    """,  # noqa: S608  # no part of it comes from outside
}

# The statements that create the refusing triggers, by name.
_REFUSING = {
    "sqlite": {
        name: f"CREATE TRIGGER {name} {when} WHEN {condition}"
        f" BEGIN SELECT RAISE(ABORT, '{when.split()[-1]} {APPEND_ONLY}'); END"
        for name, (when, condition) in _SQLITE.items()
    },
    "postgresql": {
        **{
            name: f"CREATE TRIGGER {name} {when} {condition} EXECUTE FUNCTION audit_refuse()"
            for name, (when, condition) in _POSTGRESQL.items()
        },
        "audit_record_no_delete": "CREATE TRIGGER audit_record_no_delete BEFORE DELETE ON audit_record FOR EACH ROW"
        " EXECUTE FUNCTION audit_record_refuse_delete()",
    },
}

# Texts are searched by groups of three characters (trigrams). Shorter words are compared with every text, in
# the order of record numbers. The texts are read from an index, because in PostgreSQL's table they lie
# between paths of drives.
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
    "CREATE INDEX audit_content_said ON audit_content (record_id, text) WHERE text <> ''",
]
_POSTGRESQL_SEARCH = [
    "CREATE EXTENSION IF NOT EXISTS pg_trgm",
    "CREATE INDEX audit_content_trigrams ON audit_content USING gin (text gin_trgm_ops)",
    # An index entry has room for 2,700 bytes: the few longer texts have an index without the text.
    """
    CREATE INDEX audit_content_said ON audit_content (record_id) INCLUDE (text)
    WHERE text <> '' AND octet_length(text) <= 2000
    """,
    "CREATE INDEX audit_content_said_at_length ON audit_content (record_id) WHERE octet_length(text) > 2000",
]

_MADE: dict[str, dict[str, str]] = {
    "sqlite": _REFUSING["sqlite"]
    | {"audit_content_index": _SQLITE_SEARCH[1], "audit_content_unindex": _SQLITE_SEARCH[2]},
    "postgresql": _REFUSING["postgresql"],
}

CREATE = {
    "sqlite": [*_REFUSING["sqlite"].values(), *_SQLITE_SEARCH],
    "postgresql": [
        *(
            f"CREATE FUNCTION {name}() RETURNS trigger LANGUAGE plpgsql AS $${body}$$"
            for name, body in _POSTGRESQL_FUNCTIONS.items()
        ),
        *_REFUSING["postgresql"].values(),
        *_POSTGRESQL_SEARCH,
    ],
}


def expect(vendor: str, made: dict[str, str]) -> None:
    """Add the triggers of another app, by name: verification expects them, too."""
    _MADE[vendor] |= made


# --- whether they are as they were made -------------------------------------------------------------


class _Trigger(NamedTuple):
    """A trigger that is in the database."""

    name: str
    is_on: bool
    definition: str


def amiss(connection: BaseDatabaseWrapper) -> dict[str, str]:
    """Return the faults of the database's triggers, by name; triggers without a fault are left out.

    Triggers of all tables are checked. A trigger that the console did not make might copy expiring content to
    another table, or change the log when another table is written. So might one of PostgreSQL's rules.
    """
    vendor = connection.vendor
    there = {"sqlite": _on_sqlite, "postgresql": _on_postgresql}[vendor](connection)
    made = {name: _made(vendor, statement) for name, statement in _MADE[vendor].items()}
    put_in = {
        trigger.name: "is none that the console made"
        for trigger in there
        if trigger.definition != made.get(trigger.name)
    }
    return put_in | {
        name: wrong
        for name, definition in made.items()
        if (wrong := _wrong(definition, [trigger for trigger in there if trigger.name == name]))
    }


def _wrong(definition: str, there: list[_Trigger]) -> str:
    """Return the fault of the triggers with this name; blank: none."""
    if not there:
        return "is missing"
    switches = [trigger.is_on for trigger in there if trigger.definition == definition]
    if not switches:
        return "differs from the console’s own trigger"
    return "" if any(switches) else "is switched off"


def _made(vendor: str, statement: str) -> str:
    """Return the definition that the database shows for a trigger that this statement made."""
    if vendor == "sqlite":
        return _words(statement)
    function = statement.rsplit(" ", 1)[1].removesuffix("()")
    return _of_postgresql(statement, "plpgsql", _POSTGRESQL_FUNCTIONS[function], "")


def _on_sqlite(connection: BaseDatabaseWrapper) -> list[_Trigger]:
    with connection.cursor() as cursor:
        cursor.execute("SELECT name, sql FROM sqlite_master WHERE type = 'trigger'")
        return [_Trigger(name, True, _words(statement)) for name, statement in cursor.fetchall()]


def _on_postgresql(connection: BaseDatabaseWrapper) -> list[_Trigger]:
    with connection.cursor() as cursor:
        cursor.execute(
            """
            SELECT tgname, tgenabled IN ('O', 'A'), pg_get_triggerdef(pg_trigger.oid, true),
                lanname, prosrc, COALESCE(proconfig::text, '')
            FROM pg_trigger
            JOIN pg_proc ON pg_proc.oid = tgfoid
            JOIN pg_language ON pg_language.oid = prolang
            WHERE NOT tgisinternal
            """
        )
        triggers = [
            _Trigger(name, is_on, _of_postgresql(*parts)) for name, is_on, *parts in cursor.fetchall()
        ]
        cursor.execute(
            "SELECT rulename, definition FROM pg_rules WHERE schemaname NOT IN ('pg_catalog', 'information_schema')"
        )
        return triggers + [_Trigger(name, True, definition) for name, definition in cursor.fetchall()]


def _of_postgresql(trigger: str, language: str, body: str, settings: str) -> str:
    """Return a trigger with its function, in a form to compare.

    PostgreSQL stores the condition in its own form.
    """
    condition_as_written = _words(trigger).lower().replace("::text", "")
    return "\n".join((condition_as_written, language, _words(body), settings))


def _words(statement: str) -> str:
    return " ".join(statement.split())
