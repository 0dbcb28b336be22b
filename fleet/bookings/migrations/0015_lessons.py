from django.db import migrations

from fleet.bookings import overlaps


def name_lessons(apps, _schema_editor):
    """Until now, a lesson was a booking with a series and a course."""
    apps.get_model("bookings", "Booking").objects.exclude(series=None).exclude(course=None).update(
        shared="course"
    )


def forbid_overlaps(_apps, schema_editor):
    """SQLite made the table anew for the column `shared`, without the triggers."""
    if schema_editor.connection.vendor == "sqlite":
        for name, statement in overlaps.TRIGGERS.items():
            schema_editor.execute(f"DROP TRIGGER IF EXISTS {name}")
            schema_editor.execute(statement)


class Migration(migrations.Migration):
    dependencies = [("bookings", "0014_shared_bookings")]

    operations = [
        migrations.RunPython(name_lessons, migrations.RunPython.noop),
        migrations.RunPython(forbid_overlaps, migrations.RunPython.noop),
    ]
