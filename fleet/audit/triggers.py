"""What makes the audit table append-only in the database itself.

Against mistakes and against an application that was broken into; somebody who may drop triggers can still
change the past. On PostgreSQL give the application's role INSERT and SELECT only.
"""

from __future__ import annotations

SQLITE_CREATE = [
    """
    CREATE TRIGGER audit_record_no_update BEFORE UPDATE ON audit_record
    BEGIN SELECT RAISE(ABORT, 'audit_record is append-only'); END
    """,
    """
    CREATE TRIGGER audit_record_no_delete BEFORE DELETE ON audit_record
    BEGIN SELECT RAISE(ABORT, 'audit_record is append-only'); END
    """,
    # INSERT OR REPLACE deletes the old row without asking the trigger above.
    """
    CREATE TRIGGER audit_record_no_replace BEFORE INSERT ON audit_record
    WHEN EXISTS (SELECT 1 FROM audit_record WHERE id = NEW.id)
    BEGIN SELECT RAISE(ABORT, 'audit_record is append-only'); END
    """,
]
SQLITE_DROP = [
    "DROP TRIGGER audit_record_no_update",
    "DROP TRIGGER audit_record_no_delete",
    "DROP TRIGGER audit_record_no_replace",
]

POSTGRESQL_CREATE = [
    """
    CREATE FUNCTION audit_record_refuse() RETURNS trigger LANGUAGE plpgsql AS $$
    BEGIN RAISE EXCEPTION 'audit_record is append-only' USING ERRCODE = 'integrity_constraint_violation'; END $$
    """,
    """
    CREATE TRIGGER audit_record_no_change BEFORE UPDATE OR DELETE ON audit_record
    FOR EACH ROW EXECUTE FUNCTION audit_record_refuse()
    """,
    """
    CREATE TRIGGER audit_record_no_truncate BEFORE TRUNCATE ON audit_record
    FOR EACH STATEMENT EXECUTE FUNCTION audit_record_refuse()
    """,
]
POSTGRESQL_DROP = [
    "DROP TRIGGER audit_record_no_truncate ON audit_record",
    "DROP TRIGGER audit_record_no_change ON audit_record",
    "DROP FUNCTION audit_record_refuse()",
]

CREATE = {"sqlite": SQLITE_CREATE, "postgresql": POSTGRESQL_CREATE}
DROP = {"sqlite": SQLITE_DROP, "postgresql": POSTGRESQL_DROP}
