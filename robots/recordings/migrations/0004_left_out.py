from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies = [("recordings", "0003_files_to_change")]

    operations = [
        migrations.AddField("recording", "left_out", models.PositiveIntegerField(default=0)),
    ]
