"""The admin's own log goes: it kept names of people for ever. The audit log has what was done since it is there."""

from django.db import migrations


def clear(apps, schema_editor):
    entries = apps.get_model("admin", "LogEntry").objects.using(schema_editor.connection.alias)
    entries.all().delete()


class Migration(migrations.Migration):
    dependencies = [
        ("accounts", "0002_words"),
        ("admin", "0003_logentry_add_action_flag_choices"),
    ]

    operations = [
        migrations.RunPython(clear, migrations.RunPython.noop),
    ]
