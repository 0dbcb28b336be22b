from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies = [("robots", "0008_bridge_hosts")]
    operations = [
        migrations.AddField(
            "bridgestatus", "host", models.CharField(blank=True, db_default="", default="", max_length=64)
        ),
    ]
