from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies = [("recordings", "0004_left_out")]

    operations = [
        migrations.AddField("recording", "object", models.CharField(blank=True, max_length=400)),
        migrations.AddIndex(
            "recording", models.Index(fields=["object", "place"], name="recordings_by_object")
        ),
    ]
