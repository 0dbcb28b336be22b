import django.db.models.deletion
from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies = [
        ("access", "0004_plain_texts"),
        ("bookings", "0009_notifications"),
    ]

    operations = [
        migrations.AddField(
            model_name="waiting",
            name="course",
            field=models.ForeignKey(
                blank=True,
                null=True,
                on_delete=django.db.models.deletion.SET_NULL,
                related_name="waiting",
                to="access.course",
            ),
        ),
        migrations.AddField(
            model_name="waiting",
            name="purpose",
            field=models.CharField(
                blank=True, db_default="", default="", max_length=120, verbose_name="purpose"
            ),
        ),
    ]
