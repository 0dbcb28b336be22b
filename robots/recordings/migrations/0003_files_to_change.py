from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies = [("recordings", "0002_kept_files")]

    operations = [
        migrations.AddIndex(
            "recording",
            models.Index(
                fields=["id", "place", "kept_at", "file_kept", "file"], name="recordings_to_change"
            ),
        ),
    ]
