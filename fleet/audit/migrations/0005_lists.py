"""What the lists of the admin need: indexes, models to list by, and on SQLite the index of texts as a model."""

from django.db import migrations, models

# Texts in order of their numbers, for words that are too short for trigrams. PostgreSQL's indexes hold no long text.
SAID = {
    "sqlite": "CREATE INDEX audit_content_said ON audit_content (record_id, text) WHERE text <> ''",
    "postgresql": "CREATE INDEX audit_content_said ON audit_content (record_id) WHERE text <> ''",
}


def index_texts(_apps, schema_editor):
    schema_editor.execute(SAID[schema_editor.connection.vendor])


def unindex_texts(_apps, schema_editor):
    schema_editor.execute("DROP INDEX audit_content_said")


class Migration(migrations.Migration):
    dependencies = [
        ("audit", "0004_chain"),
    ]

    operations = [
        migrations.CreateModel(
            name="ContentSearch",
            fields=[
                ("rowid", models.BigIntegerField(primary_key=True, serialize=False)),
                ("text", models.TextField()),
            ],
            options={
                "db_table": "audit_content_search",
                "managed": False,
            },
        ),
        migrations.CreateModel(
            name="MotionRecord",
            fields=[],
            options={
                "verbose_name": "drive or motion",
                "verbose_name_plural": "Motion history",
                "proxy": True,
                "indexes": [],
                "constraints": [],
            },
            bases=("audit.record",),
        ),
        migrations.CreateModel(
            name="RefusalRecord",
            fields=[],
            options={
                "verbose_name": "refusal or gate intervention",
                "verbose_name_plural": "Refusals and gate interventions",
                "proxy": True,
                "indexes": [],
                "constraints": [],
            },
            bases=("audit.record",),
        ),
        migrations.CreateModel(
            name="SpeechRecord",
            fields=[],
            options={
                "verbose_name": "text",
                "verbose_name_plural": "Speech history",
                "proxy": True,
                "indexes": [],
                "constraints": [],
            },
            bases=("audit.record",),
        ),
        migrations.AlterModelOptions(
            name="record",
            options={"ordering": ["-id"], "verbose_name": "record", "verbose_name_plural": "Everything"},
        ),
        migrations.RemoveIndex(
            model_name="record",
            name="audit_robot",
        ),
        migrations.RemoveIndex(
            model_name="record",
            name="audit_robot_kind",
        ),
        migrations.RemoveIndex(
            model_name="record",
            name="audit_by_actor",
        ),
        migrations.AddIndex(
            model_name="record",
            index=models.Index(fields=["robot_id", "id", "day", "of", "actor", "kind"], name="audit_robot"),
        ),
        migrations.AddIndex(
            model_name="record",
            index=models.Index(
                fields=["actor", "id", "day", "of", "robot_id", "kind"], name="audit_by_actor"
            ),
        ),
        # Where several would do, SQLite takes the newest: the person's before the robot's before the outcome's.
        migrations.AddIndex(
            model_name="record",
            index=models.Index(
                fields=["kind", "outcome", "id", "day", "of", "robot_id", "actor"], name="audit_kind_outcome"
            ),
        ),
        migrations.AddIndex(
            model_name="record",
            index=models.Index(
                fields=["robot_id", "kind", "id", "day", "of", "actor", "outcome"], name="audit_robot_kind"
            ),
        ),
        migrations.AddIndex(
            model_name="record",
            index=models.Index(
                fields=["actor", "kind", "id", "day", "of", "robot_id", "outcome"], name="audit_actor_kind"
            ),
        ),
        migrations.RunPython(index_texts, unindex_texts),
    ]
