"""Why a control session ended is read from the audit log, where names and free words expire and can be erased."""

from django.db import migrations


class Migration(migrations.Migration):
    dependencies = [
        ("teleop", "0002_words"),
    ]

    operations = [
        migrations.RemoveField(model_name="controlsession", name="end_note"),
    ]
