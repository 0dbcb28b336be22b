"""The whole log: actors and what may expire in tables of their own, a chain for each robot, triggers for all of it.

What was recorded before keeps its numbers and times and gets its places in the chains; its free text, names and addresses move to
where they can expire. There is no way back: a chain that was taken apart would prove nothing.
"""

import datetime
import secrets

import django.db.models.deletion
from django.db import migrations, models
from django.db.models import Max

from fleet.audit import triggers
from fleet.audit.canonical import NO_ROBOT, content_digest, first_digest, next_digest, plain

AT_ONCE = 1000  # records in memory
# What stood among the parameters, and is not to stay for ever.
PRIVATE = {
    "address",
    "browser",
    "by",
    "changes",
    "fields",
    "holder",
    "name",
    "reason",
    "system_account",
    "to_name",
    "username",
    "value",
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


def lift_triggers(_apps, schema_editor):
    for statement in DROP[schema_editor.connection.vendor]:
        schema_editor.execute(statement)


def make_triggers(_apps, schema_editor):
    for statement in triggers.CREATE[schema_editor.connection.vendor]:
        schema_editor.execute(statement, params=None)
    if schema_editor.connection.vendor == "sqlite":
        # The index knows nothing yet of the texts that were there before.
        schema_editor.execute("INSERT INTO audit_content_search (audit_content_search) VALUES ('rebuild')")


def chain_what_is_there(apps, schema_editor):
    Actor, Chain, Record, Content = (
        apps.get_model("audit", name)._base_manager.using(schema_editor.connection.alias)
        for name in ("Actor", "Chain", "Record", "Content")
    )
    named = Record.exclude(old_actor_id="").values("old_actor_id").annotate(last=Max("id")).values("last")
    for key, name in Record.filter(pk__in=list(named.values_list("last", flat=True))).values_list(
        "old_actor_id", "actor_name"
    ):
        Actor.create(id=key, name=name)
    for robot_id in Record.order_by().values_list("robot_id", flat=True).distinct():
        records = Record.filter(robot_id=robot_id)
        chain = robot_id or NO_ROBOT
        named = records.exclude(robot_name="").order_by("-id")
        Chain.create(id=chain, name=named.values_list("robot_name", flat=True).first() or "")
        _chain(records.order_by("id"), Record, Content, first_digest(chain))


def _chain(records, Record, Content, digest):
    last, seq = 0, 0
    while page := list(records.filter(id__gt=last)[:AT_ONCE]):
        for record in page:
            seq += 1
            record.seq, record.day = seq, record.at.astimezone(datetime.timezone.utc).date()
            record.actor_id = record.old_actor_id or None
            content = _content(record)
            record.digest = digest = next_digest(digest, record)
            Record.filter(pk=record.pk).update(
                seq=seq,
                day=record.day,
                actor_id=record.actor_id,
                parameters=record.parameters,
                outcome=record.outcome,
                content_digest=record.content_digest,
                digest=digest,
            )
            if content:
                Content.create(record_id=record.pk, **content)
        last = page[-1].pk


def _content(record):
    """Take out of the parameters what is not to stay, and give the record the digest of it."""
    told = plain(record.parameters)
    text = told.pop("text", "")
    data = {name: told.pop(name) for name in PRIVATE & set(told)}
    record.parameters = told
    if record.kind == "drive.end" and record.outcome != "standstill":
        # In words, which may name who stopped it.
        data["words"], record.outcome = record.outcome, "halted"
    if not text and not data:
        return None
    content = {"text": text, "data": data, "salt": secrets.token_hex(16)}
    record.content_digest = content_digest(content["salt"], text, data)
    return content


class Migration(migrations.Migration):
    dependencies = [("audit", "0003_robot_kind")]

    operations = [
        migrations.RunPython(lift_triggers),
        migrations.RemoveIndex(model_name="record", name="audit_actor"),  # a table has this name now
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
            name="Content",
            fields=[
                (
                    "record",
                    models.OneToOneField(
                        on_delete=django.db.models.deletion.PROTECT,
                        primary_key=True,
                        related_name="content",
                        serialize=False,
                        to="audit.record",
                    ),
                ),
                ("text", models.TextField(blank=True)),
                ("data", models.JSONField(blank=True, default=dict)),
                ("salt", models.CharField(max_length=32)),
            ],
        ),
        migrations.RenameField(model_name="record", old_name="actor_id", new_name="old_actor_id"),
        migrations.AddField(
            model_name="record",
            name="actor",
            field=models.ForeignKey(
                blank=True,
                db_index=False,
                null=True,
                on_delete=django.db.models.deletion.PROTECT,
                related_name="records",
                to="audit.actor",
            ),
        ),
        migrations.AddField(
            model_name="record",
            name="real_actor",
            field=models.ForeignKey(
                blank=True,
                db_index=False,
                null=True,
                on_delete=django.db.models.deletion.PROTECT,
                related_name="+",
                to="audit.actor",
            ),
        ),
        migrations.AddField(
            model_name="record",
            name="day",
            field=models.DateField(
                default=datetime.date(1970, 1, 1), editable=False, verbose_name="day (UTC)"
            ),
            preserve_default=False,
        ),
        migrations.AddField(
            model_name="record",
            name="seq",
            field=models.BigIntegerField(default=0, editable=False, verbose_name="place in its chain"),
            preserve_default=False,
        ),
        migrations.AddField(
            model_name="record",
            name="digest",
            field=models.CharField(default="", editable=False, max_length=64),
            preserve_default=False,
        ),
        migrations.AddField(
            model_name="record",
            name="content_digest",
            field=models.CharField(blank=True, default="", editable=False, max_length=64),
            preserve_default=False,
        ),
        migrations.AlterField(
            model_name="record",
            name="of",
            field=models.ForeignKey(
                blank=True,
                db_constraint=False,
                null=True,
                on_delete=django.db.models.deletion.DO_NOTHING,
                related_name="outcomes",
                to="audit.record",
                verbose_name="outcome of",
            ),
        ),
        migrations.RunPython(chain_what_is_there),
        migrations.RemoveField(model_name="record", name="old_actor_id"),
        migrations.RemoveField(model_name="record", name="actor_name"),
        migrations.AddConstraint(
            model_name="record",
            constraint=models.UniqueConstraint(fields=("robot_id", "seq"), name="audit_chain_place"),
        ),
        migrations.AddConstraint(
            model_name="record",
            constraint=models.UniqueConstraint(
                condition=models.Q(("robot_id", None)), fields=("seq",), name="audit_chain_place_no_robot"
            ),
        ),
        migrations.AddIndex(
            model_name="record", index=models.Index(fields=["kind", "id"], name="audit_kind")
        ),
        migrations.AddIndex(model_name="record", index=models.Index(fields=["day", "id"], name="audit_day")),
        migrations.AddIndex(
            model_name="record", index=models.Index(fields=["actor", "id"], name="audit_by_actor")
        ),
        migrations.AddIndex(
            model_name="record",
            index=models.Index(
                condition=models.Q(("real_actor__isnull", False)),
                fields=["real_actor"],
                name="audit_real_actor",
            ),
        ),
        migrations.RunPython(make_triggers),
    ]
