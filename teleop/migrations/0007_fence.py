from django.db import migrations, models


class Migration(migrations.Migration):

    dependencies = [
        ('teleop', '0006_keyed_request'),
    ]

    operations = [
        migrations.AlterField(
            model_name='controlsession',
            name='fence',
            field=models.BigIntegerField(verbose_name='fence'),
        ),
    ]
