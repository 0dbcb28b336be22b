"""Two robots cannot share a bridge address. Where they do, the link lets only that one through whose bridge it is."""

import logging
from collections import Counter
from typing import Any

from django.db import migrations, models

log = logging.getLogger(__name__)


def tell_apart(apps: Any, _editor: object) -> None:
    """Mark an address that is there already: `#2` behind the port, which leads to the same place.

    So nothing changes for a robot that runs, and its next edit asks for an address of its own.
    """
    robots = apps.get_model("robots", "Robot").objects
    seen: Counter[str] = Counter()
    for robot in robots.exclude(bridge_address="").order_by("slug"):
        address = robot.bridge_address
        seen[address] += 1
        if seen[address] > 1:
            robots.filter(pk=robot.pk).update(bridge_address=f"{address}#{seen[address]}")
            log.warning("Robot %s has the bridge address of another, %s: correct it.", robot.slug, address)


class Migration(migrations.Migration):
    dependencies = [
        ("robots", "0007_map"),
    ]

    operations = [
        migrations.RunPython(tell_apart, migrations.RunPython.noop),
        migrations.AddConstraint(
            model_name="robot",
            constraint=models.UniqueConstraint(
                condition=models.Q(("bridge_address", ""), _negated=True),
                fields=("bridge_address",),
                name="one_robot_per_bridge_address",
                violation_error_code="unique",
                violation_error_message="Another robot's bridge listens there already: each needs a host or a port of its own.",
            ),
        ),
    ]
