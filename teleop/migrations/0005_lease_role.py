"""The role in which somebody got control. Who has it just now counts as an operator, below whom nobody has it."""

from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies = [
        ("teleop", "0004_session_start"),
    ]

    operations = [
        migrations.AddField(
            model_name="lease",
            name="role",
            field=models.CharField(blank=True, default="operator", max_length=16),
            preserve_default=False,
        ),
    ]
