from __future__ import annotations

from django.db import migrations, models
from django.utils import timezone


class Migration(migrations.Migration):
    dependencies = [("teleop", "0011_alerts")]

    operations = [
        migrations.AddField(
            "alert", "seen_at", models.DateTimeField(default=timezone.now), preserve_default=False
        ),
    ]
