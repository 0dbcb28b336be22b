import django.core.validators
from django.db import migrations, models


class Migration(migrations.Migration):

    dependencies = [
        ('robots', '0003_robot_description'),
    ]

    operations = [
        migrations.AlterField(
            model_name='robot',
            name='fence',
            field=models.BigIntegerField(default=0, editable=False, verbose_name='highest fence'),
        ),
        migrations.AlterField(
            model_name='robotprofile',
            name='forward_mps',
            field=models.FloatField(help_text='Top speed of this kind of robot.', validators=[django.core.validators.MinValueValidator(0.05), django.core.validators.MaxValueValidator(3.0)], verbose_name='forward, m/s'),
        ),
    ]
