"""What others recorded in one's control sessions is found without looking into the table for all one did oneself."""

from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies = [
        ("audit", "0006_fast_lists"),
    ]

    operations = [
        migrations.RemoveIndex(model_name="record", name="audit_session"),
        migrations.AddIndex(
            model_name="record",
            index=models.Index(
                fields=["session_id", "id", "of", "actor", "real_actor"], name="audit_session"
            ),
        ),
    ]
