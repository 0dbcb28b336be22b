"""``manage.py check_robot`` in a test."""

from __future__ import annotations

import json
from io import StringIO
from typing import Any

from django.core.management import call_command

from robots.registry.models import Robot


def check(robot: Robot, **changes: Any) -> dict[str, dict[str, str]]:
    """Run the command for a robot with these columns; return its answers by name."""
    Robot.objects.filter(pk=robot.pk).update(**changes)
    out = StringIO()
    try:
        call_command("check_robot", robot.slug, "--json", stdout=out)
        failed = False
    except SystemExit as ended:
        failed = ended.code == 1
    answers = {answer["name"]: answer for answer in json.loads(out.getvalue())}
    assert failed == any(answer["level"] == "fail" for answer in answers.values())
    return answers
