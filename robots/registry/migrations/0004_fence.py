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
    ]
