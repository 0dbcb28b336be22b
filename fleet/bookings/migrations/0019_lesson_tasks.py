from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies = [("bookings", "0018_notifications_of_moments")]

    operations = [
        migrations.AddField(
            model_name="booking",
            name="tasks",
            field=models.JSONField(blank=True, null=True),
        ),
    ]
