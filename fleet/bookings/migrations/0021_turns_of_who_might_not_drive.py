from django.db import migrations, models


class Migration(migrations.Migration):

    dependencies = [
        ('bookings', '0020_offers_to_share'),
    ]

    operations = [
        migrations.AlterField(
            model_name='turn',
            name='state',
            field=models.CharField(choices=[('waiting', 'waiting'), ('called', 'called'), ('driving', 'driving'), ('done', 'done'), ('skipped', 'skipped'), ('missed', 'missed'), ('refused', 'refused')], default='waiting', max_length=8),
        ),
    ]
