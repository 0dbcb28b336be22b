from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies = [("recordings", "0006_files_to_cut")]

    operations = [
        migrations.AddField("recording", "controls", models.JSONField(null=True)),
    ]
