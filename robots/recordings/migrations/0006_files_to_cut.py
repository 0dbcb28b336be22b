from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies = [("recordings", "0005_objects")]

    operations = [
        migrations.AddField("recording", "stays", models.JSONField(blank=True, null=True)),
        migrations.AddIndex(
            "recording",
            models.Index(
                fields=["id"], condition=models.Q(stays__isnull=False), name="recordings_to_cut"
            ),
        ),
    ]
