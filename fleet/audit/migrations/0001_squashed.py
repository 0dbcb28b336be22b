import django.db.models.deletion
import django.utils.timezone
import uuid
from django.db import migrations, models

from fleet.audit.integrity import triggers


def make_triggers(_apps, schema_editor):
    for statement in triggers.CREATE[schema_editor.connection.vendor]:
        schema_editor.execute(statement, params=None)


class Migration(migrations.Migration):
    initial = True

    replaces = [
        ("audit", "0001_initial"),
        ("audit", "0002_append_only"),
        ("audit", "0003_robot_kind"),
        ("audit", "0004_chain"),
        ("audit", "0005_lists"),
        ("audit", "0006_fast_lists"),
        ("audit", "0007_sessions_of_others"),
    ]

    dependencies = []

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
            name="Actor",
            fields=[
                ("id", models.CharField(max_length=64, primary_key=True, serialize=False)),
                ("name", models.CharField(max_length=200)),
                ("erased_at", models.DateTimeField(blank=True, null=True, verbose_name="erased (UTC)")),
            ],
        ),
        migrations.CreateModel(
            name="Chain",
            fields=[
                ("id", models.UUIDField(primary_key=True, serialize=False)),
                ("name", models.CharField(blank=True, max_length=200)),
            ],
        ),
        migrations.CreateModel(
            name="Record",
            fields=[
                ("id", models.BigAutoField(primary_key=True, serialize=False, verbose_name="order number")),
                ("at", models.DateTimeField(default=django.utils.timezone.now, editable=False, verbose_name="time (UTC)")),
                ("day", models.DateField(editable=False, verbose_name="day (UTC)")),
                ("kind", models.CharField(max_length=64)),
                ("robot_id", models.UUIDField(blank=True, null=True, verbose_name="robot's id")),
                ("robot_name", models.CharField(blank=True, max_length=200, verbose_name="robot")),
                ("session_id", models.UUIDField(blank=True, null=True, verbose_name="control session")),
                ("fence", models.BigIntegerField(blank=True, null=True, verbose_name="fencing number")),
                ("request_id", models.UUIDField(default=uuid.uuid4, verbose_name="request")),
                ("outcome", models.CharField(blank=True, max_length=200)),
                ("parameters", models.JSONField(blank=True, default=dict)),
                ("content_digest", models.CharField(blank=True, editable=False, max_length=64)),
                ("seq", models.BigIntegerField(editable=False, verbose_name="place in its chain")),
                ("digest", models.CharField(editable=False, max_length=64)),
                ("actor", models.ForeignKey(blank=True, db_index=False, null=True, on_delete=django.db.models.deletion.PROTECT, related_name="records", to="audit.actor")),
                ("of", models.ForeignKey(blank=True, db_constraint=False, db_index=False, null=True, on_delete=django.db.models.deletion.DO_NOTHING, related_name="outcomes", to="audit.record", verbose_name="outcome of")),
                ("real_actor", models.ForeignKey(blank=True, db_index=False, null=True, on_delete=django.db.models.deletion.PROTECT, related_name="+", to="audit.actor")),
            ],
            options={
                "verbose_name": "record",
                "verbose_name_plural": "Everything",
                "ordering": ["-id"],
            },
        ),
        migrations.CreateModel(
            name="Content",
            fields=[
                ("record", models.OneToOneField(on_delete=django.db.models.deletion.PROTECT, primary_key=True, related_name="content", serialize=False, to="audit.record")),
                ("text", models.TextField(blank=True)),
                ("data", models.JSONField(blank=True, default=dict)),
                ("salt", models.CharField(max_length=32)),
            ],
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
        migrations.AddIndex(
            model_name="record",
            index=models.Index(fields=["kind", "at"], name="audit_kind_at"),
        ),
        migrations.AddConstraint(
            model_name="record",
            constraint=models.UniqueConstraint(fields=("robot_id", "seq"), name="audit_chain_place"),
        ),
        migrations.AddConstraint(
            model_name="record",
            constraint=models.UniqueConstraint(condition=models.Q(("robot_id", None)), fields=("seq",), name="audit_chain_place_no_robot"),
        ),
        migrations.AddIndex(
            model_name="record",
            index=models.Index(fields=["kind", "id"], name="audit_kind"),
        ),
        migrations.AddIndex(
            model_name="record",
            index=models.Index(fields=["day", "id"], name="audit_day"),
        ),
        migrations.AddIndex(
            model_name="record",
            index=models.Index(fields=["robot_id", "id", "day", "of", "actor", "kind"], name="audit_robot"),
        ),
        migrations.AddIndex(
            model_name="record",
            index=models.Index(fields=["actor", "id", "day", "of", "robot_id", "kind"], name="audit_by_actor"),
        ),
        # Where several would do, SQLite takes the newest: the person's before the robot's before the outcome's.
        migrations.AddIndex(
            model_name="record",
            index=models.Index(fields=["kind", "outcome", "id", "day", "of", "robot_id", "actor"], name="audit_kind_outcome"),
        ),
        migrations.AddIndex(
            model_name="record",
            index=models.Index(fields=["robot_id", "kind", "id", "day", "of", "actor", "outcome"], name="audit_robot_kind"),
        ),
        migrations.AddIndex(
            model_name="record",
            index=models.Index(fields=["actor", "kind", "id", "day", "of", "robot_id", "outcome"], name="audit_actor_kind"),
        ),
        migrations.AddIndex(
            model_name="record",
            index=models.Index(condition=models.Q(("actor", None)), fields=["id", "kind", "day", "of", "robot_id", "outcome"], name="audit_no_actor"),
        ),
        migrations.AddIndex(
            model_name="record",
            index=models.Index(condition=models.Q(("robot_id", None)), fields=["id", "kind", "day", "of", "actor", "outcome"], name="audit_no_robot"),
        ),
        migrations.AddIndex(
            model_name="record",
            index=models.Index(condition=models.Q(("of__isnull", False)), fields=["of", "kind", "outcome"], name="audit_of"),
        ),
        migrations.AddIndex(
            model_name="record",
            index=models.Index(condition=models.Q(("real_actor__isnull", False)), fields=["real_actor", "id", "day", "of", "actor", "robot_id", "kind", "outcome"], name="audit_real_actor"),
        ),
        migrations.AddIndex(
            model_name="record",
            index=models.Index(fields=["session_id", "id", "of", "actor", "real_actor"], name="audit_session"),
        ),
        migrations.RunPython(make_triggers),
    ]
