"""Opening hours have a list of intervals for each weekday; there was one interval."""

from typing import Any

from django.db import migrations


def to_intervals(apps: Any, _schema: Any) -> None:
    _change(apps, lambda hours: [hours] if isinstance(hours[0], str) else hours)


def to_one_interval(apps: Any, _schema: Any) -> None:
    """Keep the time from the first opening to the last closing."""
    _change(apps, lambda hours: [hours[0][0], hours[-1][1]])


def _change(apps: Any, change: Any) -> None:
    for policy in apps.get_model("bookings", "Policy").objects.all():
        policy.opening = {day: change(hours) for day, hours in policy.opening.items()}
        policy.save(update_fields=["opening"])


class Migration(migrations.Migration):
    dependencies = [("bookings", "0010_purpose_of_waiting")]

    operations = [migrations.RunPython(to_intervals, to_one_interval)]
