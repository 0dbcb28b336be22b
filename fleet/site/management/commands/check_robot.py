"""``manage.py check_robot SLUG [--json]``: check whether this robot can be driven from here, with remedies."""

from __future__ import annotations

import sys
from typing import Any

from django.core.management.base import BaseCommand, CommandError, CommandParser

from robots.check.results import FAIL, OK, Check
from robots.check.robot_check import run_checks
from robots.registry.models import Robot
from robots.shared import wire


class Command(BaseCommand):
    help = "Check a robot's master, names, clock and topics; exit 1 if a check fails."

    def add_arguments(self, parser: CommandParser) -> None:
        parser.add_argument("slug")
        parser.add_argument("--json", action="store_true", help="print JSON")

    def handle(self, *args: Any, **options: Any) -> None:
        robot = Robot.objects.select_related("profile").filter(slug=options["slug"]).first()
        if robot is None:
            raise CommandError(f"There is no robot {options['slug']!r}.")
        checks = run_checks(robot)
        if options["json"]:
            self.stdout.write(wire.encode(checks).decode())
        else:
            for check in checks:
                self._print(check)
        if any(check.level == FAIL for check in checks):
            sys.exit(1)

    def _print(self, check: Check) -> None:
        style = {OK: self.style.SUCCESS, FAIL: self.style.ERROR}.get(check.level, self.style.WARNING)
        self.stdout.write(f"{style(f'{check.level:4}')}  {check.name}: {check.text}")
        if check.advice:
            self.stdout.write(f"      {check.advice}")
