"""Adds an administrator ("first"), two robots and many people to a console's database; prints their keys as JSON."""

import json
import sys

import django

django.setup()

from benchmarks.attacks.people import crowd  # noqa: E402
from fleet.accounts.models import User  # noqa: E402
from robots.registry.models import Robot, RobotProfile  # noqa: E402

User.objects.create_superuser("first", "", sys.argv[1])
ROBOTS = {
    slug: Robot.objects.create(
        slug=slug,
        name=slug,
        profile=RobotProfile.objects.get(slug="tiago"),
        master_uri="http://127.0.0.1:9",
        enabled=slug == "in-service",
    ).id.hex
    for slug in ("in-service", "out-of-service")
}
print(json.dumps({"robots": ROBOTS, **crowd()}))
