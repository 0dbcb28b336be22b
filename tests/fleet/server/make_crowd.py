"""Adds an administrator ("first"), robots and many people to a console's database; prints their keys as JSON.

Only the `presser` may stop the robot "apart": it hears no late stop of a flood.
"""

import json
import sys

import django

django.setup()

from benchmarks.attacks.people import crowd  # noqa: E402
from fleet.accounts.models import User  # noqa: E402
from robots.registry.models import Robot, RobotProfile, RobotRole, Role  # noqa: E402

User.objects.create_superuser("first", "", sys.argv[1])


def robot(slug, *, enabled=True):
    profile = RobotProfile.objects.get(slug="tiago")
    return Robot.objects.create(
        slug=slug, name=slug, profile=profile, master_uri="http://127.0.0.1:9", enabled=enabled
    )


robots = [robot("in-service"), robot("out-of-service", enabled=False)]
people = crowd()
robots.append(robot("apart"))
presser = User.objects.get(username="presser-0")
RobotRole.objects.filter(user=presser, robot=robots[0]).delete()
RobotRole.objects.create(user=presser, robot=robots[2], role=Role.OBSERVER)
print(json.dumps({"robots": {one.slug: one.id.hex for one in robots}, **people}))
