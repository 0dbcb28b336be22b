from django.conf import settings
from django.db import migrations, models


class Migration(migrations.Migration):

    dependencies = [
        ('bookings', '0019_lesson_tasks'),
        migrations.swappable_dependency(settings.AUTH_USER_MODEL),
    ]

    operations = [
        migrations.RemoveConstraint(
            model_name='handoffer',
            name='one_open_hand_offer_per_booking',
        ),
        migrations.AddField(
            model_name='handoffer',
            name='share',
            field=models.BooleanField(db_default=False, default=False),
        ),
        migrations.AddConstraint(
            model_name='handoffer',
            constraint=models.UniqueConstraint(condition=models.Q(('outcome', ''), ('share', False)), fields=('booking',), name='one_open_hand_offer_per_booking'),
        ),
    ]
