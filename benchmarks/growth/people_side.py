"""Make people who may see every robot, and sign them in. Prints the Cookie headers, and the robots' keys by slug."""

from __future__ import annotations

import json
import sys

from django.conf import settings
from django.test import Client

from fleet.accounts.models import User
from robots.registry.models import Robot, RobotRole, Role


def main() -> None:
    """Make as many people as the command line says."""
    robots = list(Robot.objects.all())
    cookies = []
    for number in range(int(sys.argv[1])):
        person = User.objects.create(username=f"growth-{number}", full_name=f"Growth {number}")
        RobotRole.objects.bulk_create(
            RobotRole(robot=robot, user=person, role=Role.OPERATOR) for robot in robots
        )
        client = Client()
        client.force_login(person)
        name = settings.SESSION_COOKIE_NAME
        cookies.append(f"{name}={client.cookies[name].value}")
    print(json.dumps({"cookies": cookies, "robots": {robot.slug: str(robot.pk) for robot in robots}}))
