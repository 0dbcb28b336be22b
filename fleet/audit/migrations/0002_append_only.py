"""Triggers that make the audit table append-only in the database itself. 0004 replaces them."""

from django.db import migrations

CREATE = {
    "sqlite": [
        """
        CREATE TRIGGER audit_record_no_update BEFORE UPDATE ON audit_record
        BEGIN SELECT RAISE(ABORT, 'audit_record is append-only'); END
        """,
        """
        CREATE TRIGGER audit_record_no_delete BEFORE DELETE ON audit_record
        BEGIN SELECT RAISE(ABORT, 'audit_record is append-only'); END
        """,
        """
        CREATE TRIGGER audit_record_no_replace BEFORE INSERT ON audit_record
        WHEN EXISTS (SELECT 1 FROM audit_record WHERE id = NEW.id)
        BEGIN SELECT RAISE(ABORT, 'audit_record is append-only'); END
        """,
    ],
    "postgresql": [
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
    ],
}
DROP = {
    "sqlite": [
        "DROP TRIGGER audit_record_no_update",
        "DROP TRIGGER audit_record_no_delete",
        "DROP TRIGGER audit_record_no_replace",
    ],
    "postgresql": [
        "DROP TRIGGER audit_record_no_truncate ON audit_record",
        "DROP TRIGGER audit_record_no_change ON audit_record",
        "DROP FUNCTION audit_record_refuse()",
    ],
}


def _run(statements):
    def run(_apps, schema_editor):
        for statement in statements[schema_editor.connection.vendor]:
            schema_editor.execute(statement)

    return run


class Migration(migrations.Migration):
    dependencies = [("audit", "0001_initial")]

    operations = [migrations.RunPython(_run(CREATE), _run(DROP))]
