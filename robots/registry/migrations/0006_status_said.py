from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies = [("robots", "0005_profile_topics")]
    operations = [
        migrations.AddField("bridgestatus", "said", models.JSONField(blank=True, default=list)),
    ]
