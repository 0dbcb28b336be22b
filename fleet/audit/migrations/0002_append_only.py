"""Triggers that make the audit table append-only in the database itself."""

from django.db import migrations

from fleet.audit import triggers


def _run(statements):
    def run(_apps, schema_editor):
        for statement in statements[schema_editor.connection.vendor]:
            schema_editor.execute(statement)

    return run


class Migration(migrations.Migration):
    dependencies = [("audit", "0001_initial")]

    operations = [migrations.RunPython(_run(triggers.CREATE), _run(triggers.DROP))]
