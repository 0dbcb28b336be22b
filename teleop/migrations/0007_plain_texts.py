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
        migrations.AlterField(
            model_name='controlsession',
            name='end_reason',
            field=models.CharField(blank=True, choices=[('released', 'given back'), ('moved', 'moved to another tab of the same person'), ('handed_over', 'handed over'), ('taken_over', 'taken over'), ('term', 'the term ended'), ('slot', 'the slot ended, or another person’s slot began'), ('away', 'the page was gone'), ('right', 'the right to control ended'), ('bridge', 'the robot’s bridge refused it')], max_length=16, verbose_name='how it ended'),
        ),
    ]
