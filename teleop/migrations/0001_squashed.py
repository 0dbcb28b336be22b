import django.db.models.deletion
import uuid
from django.conf import settings
from django.db import migrations, models


class Migration(migrations.Migration):
    initial = True

    replaces = [
        ("teleop", "0001_initial"),
        ("teleop", "0002_words"),
        ("teleop", "0003_no_end_note"),
        ("teleop", "0004_session_start"),
        ("teleop", "0005_lease_role"),
        ("teleop", "0006_apostrophes"),
    ]

    dependencies = [
        ("robots", "0001_squashed"),
        migrations.swappable_dependency(settings.AUTH_USER_MODEL),
    ]

    operations = [
        migrations.CreateModel(
            name="ControlSession",
            fields=[
                ("id", models.UUIDField(default=uuid.uuid4, editable=False, primary_key=True, serialize=False)),
                ("fence", models.BigIntegerField(verbose_name="fencing number")),
                ("started_at", models.DateTimeField(verbose_name="began")),
                ("ended_at", models.DateTimeField(blank=True, null=True, verbose_name="ended")),
                (
                    "end_reason",
                    models.CharField(
                        blank=True,
                        choices=[
                            ("released", "given back"),
                            ("moved", "moved to another tab of the same person"),
                            ("handed_over", "handed over"),
                            ("taken_over", "taken over"),
                            ("term", "the term ended"),
                            ("away", "the page was gone"),
                            ("right", "the right to control ended"),
                            ("bridge", "the robot’s bridge refused it"),
                        ],
                        max_length=16,
                        verbose_name="ended how",
                    ),
                ),
                ("robot", models.ForeignKey(on_delete=django.db.models.deletion.PROTECT, related_name="control_sessions", to="robots.robot", verbose_name="robot")),
                ("user", models.ForeignKey(on_delete=django.db.models.deletion.PROTECT, related_name="control_sessions", to=settings.AUTH_USER_MODEL, verbose_name="person")),
            ],
            options={
                "verbose_name": "control session",
                "verbose_name_plural": "control sessions",
                "ordering": ["-started_at"],
            },
        ),
        migrations.CreateModel(
            name="Lease",
            fields=[
                ("robot", models.OneToOneField(on_delete=django.db.models.deletion.CASCADE, primary_key=True, related_name="lease", serialize=False, to="robots.robot")),
                ("tab", models.CharField(blank=True, max_length=64)),
                ("sign_in", models.CharField(blank=True, max_length=64)),
                ("connection", models.CharField(blank=True, max_length=64)),
                ("role", models.CharField(blank=True, max_length=16)),
                ("term_ends_at", models.DateTimeField(blank=True, null=True)),
                ("seen_at", models.DateTimeField(blank=True, null=True)),
                ("session", models.OneToOneField(blank=True, null=True, on_delete=django.db.models.deletion.PROTECT, to="teleop.controlsession")),
            ],
        ),
        migrations.CreateModel(
            name="ControlRequest",
            fields=[
                ("id", models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name="ID")),
                ("tab", models.CharField(max_length=64)),
                ("sign_in", models.CharField(max_length=64)),
                ("connection", models.CharField(max_length=64)),
                ("asked_at", models.DateTimeField()),
                ("answered_at", models.DateTimeField(blank=True, null=True)),
                ("outcome", models.CharField(blank=True, choices=[("granted", "got control"), ("freed", "the robot became free"), ("cancelled", "withdrawn"), ("gone", "the page was gone"), ("lapsed", "nobody answered")], max_length=16)),
                ("robot", models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name="control_requests", to="robots.robot")),
                ("user", models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, to=settings.AUTH_USER_MODEL)),
            ],
            options={
                "ordering": ["asked_at"],
                "constraints": [models.UniqueConstraint(condition=models.Q(("answered_at", None)), fields=("robot", "user"), name="one_open_request_per_person")],
            },
        ),
        migrations.AddIndex(
            model_name="controlsession",
            index=models.Index(fields=["started_at"], name="session_start"),
        ),
        migrations.AddConstraint(
            model_name="controlsession",
            constraint=models.UniqueConstraint(fields=("robot", "fence"), name="one_session_per_fence"),
        ),
        migrations.AddConstraint(
            model_name="controlsession",
            constraint=models.UniqueConstraint(condition=models.Q(("ended_at", None)), fields=("robot",), name="one_open_session_per_robot"),
        ),
    ]
