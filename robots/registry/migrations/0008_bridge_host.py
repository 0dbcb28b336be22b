from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies = [("robots", "0007_room")]
    operations = [
        migrations.AddField(
            "bridgestatus", "host", models.CharField(blank=True, db_default="", default="", max_length=64)
        ),
    ]
