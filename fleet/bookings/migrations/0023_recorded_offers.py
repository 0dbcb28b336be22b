from django.db import migrations, models


class Migration(migrations.Migration):

    dependencies = [
        ('bookings', '0022_recorded'),
    ]

    operations = [
        migrations.AddField(
            model_name='waiting',
            name='record',
            field=models.BooleanField(null=True, verbose_name='record it'),
        ),
    ]
