"""What keeps the lists fast with a million records: indexes for what has no person or no robot, and of brief texts."""

import django.db.models.deletion
from django.db import migrations, models

# PostgreSQL reads texts out of an index instead of the table, where the paths of drives lie between them. An entry has
# room for 2,700 bytes; the few texts that are longer are looked for by themselves.
SAID = [
    "DROP INDEX audit_content_said",
    """
    CREATE INDEX audit_content_said ON audit_content (record_id) INCLUDE (text)
    WHERE text <> '' AND octet_length(text) <= 2000
    """,
    "CREATE INDEX audit_content_said_at_length ON audit_content (record_id) WHERE octet_length(text) > 2000",
]
SAID_BEFORE = [
    "DROP INDEX audit_content_said_at_length",
    "DROP INDEX audit_content_said",
    "CREATE INDEX audit_content_said ON audit_content (record_id) WHERE text <> ''",
]


def _run(statements):
    def run(_apps, schema_editor):
        if schema_editor.connection.vendor == "postgresql":
            for statement in statements:
                schema_editor.execute(statement)

    return run


class Migration(migrations.Migration):
    dependencies = [
        ("audit", "0005_lists"),
    ]

    operations = [
        migrations.AddIndex(
            model_name="record",
            index=models.Index(
                condition=models.Q(("actor", None)),
                fields=["id", "kind", "day", "of", "robot_id", "outcome"],
                name="audit_no_actor",
            ),
        ),
        migrations.AddIndex(
            model_name="record",
            index=models.Index(
                condition=models.Q(("robot_id", None)),
                fields=["id", "kind", "day", "of", "actor", "outcome"],
                name="audit_no_robot",
            ),
        ),
        # Not by Django, which on SQLite would make the table anew for that, and its triggers would be gone.
        migrations.RunSQL(
            "DROP INDEX audit_record_of_id_cc4b35c4",
            "CREATE INDEX audit_record_of_id_cc4b35c4 ON audit_record (of_id)",
            state_operations=[
                migrations.AlterField(
                    model_name="record",
                    name="of",
                    field=models.ForeignKey(
                        blank=True,
                        db_constraint=False,
                        db_index=False,
                        null=True,
                        on_delete=django.db.models.deletion.DO_NOTHING,
                        related_name="outcomes",
                        to="audit.record",
                        verbose_name="outcome of",
                    ),
                )
            ],
        ),
        migrations.AddIndex(
            model_name="record",
            index=models.Index(
                condition=models.Q(("of__isnull", False)), fields=["of", "kind", "outcome"], name="audit_of"
            ),
        ),
        migrations.RemoveIndex(model_name="record", name="audit_real_actor"),
        migrations.AddIndex(
            model_name="record",
            index=models.Index(
                condition=models.Q(("real_actor__isnull", False)),
                fields=["real_actor", "id", "day", "of", "actor", "robot_id", "kind", "outcome"],
                name="audit_real_actor",
            ),
        ),
        migrations.RunPython(_run(SAID), _run(SAID_BEFORE)),
    ]
