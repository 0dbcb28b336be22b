from django.db import migrations, models


class Migration(migrations.Migration):

    dependencies = [
        ('audit', '0001_squashed'),
    ]

    operations = [
        migrations.AlterField(
            model_name='record',
            name='fence',
            field=models.BigIntegerField(blank=True, null=True, verbose_name='fence'),
        ),
    ]
