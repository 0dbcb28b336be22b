"""``manage.py stop SLUG ... | --all``: press the emergency stop of robots, without web process or browser.

It does not replace a robot's red button.
"""

from __future__ import annotations

import getpass
import os
from typing import Any

from django.conf import settings
from django.core.management.base import BaseCommand, CommandError, CommandParser
from django.db import DatabaseError

from fleet.audit.command_line import here
from robots.bridge.config import LinkAddress
from robots.models import Robot
from robots.selectors import link_address
from robots.stops import press_all, record_outcome, record_press
from robots.wire import Refusal, Stopped


class Command(BaseCommand):
    """The emergency stop."""

    help = "Press the emergency stop of the named robots, or of all."
    requires_system_checks = []  # nothing comes before a stop

    def add_arguments(self, parser: CommandParser) -> None:
        """Which robots, and why."""
        parser.add_argument("slugs", nargs="*", metavar="SLUG")
        parser.add_argument("--all", action="store_true", help="every enabled robot")
        parser.add_argument("--reason", default="", help="shown on the robot's page and kept")

    def handle(self, *args: Any, **options: Any) -> None:
        """Stop all at once, then record, then say whom it did not reach."""
        slugs: list[str] = options["slugs"]
        if options["all"] == bool(slugs):
            raise CommandError("Name robots, or say --all.")
        by, reason = f"{_who()} (command line)", _clean(options["reason"])
        try:
            robots = list(
                Robot.objects.filter(slug__in=slugs) if slugs else Robot.objects.filter(enabled=True)
            )
        except DatabaseError as error:
            self._stop_without_database(slugs, by, reason, error)
            return
        results = press_all([link_address(robot) for robot in robots], by, reason)
        for robot, result in zip(robots, results, strict=True):
            self._record(robot, reason, result)
            self.stdout.write(f"{robot.slug}: {_told(result)}")
        unreached = [
            robot.slug for robot, result in zip(robots, results, strict=True) if isinstance(result, Refusal)
        ]
        if unreached:
            raise CommandError(f"Not reached: {', '.join(unreached)}. Use the red button on the robot.")
        unknown = sorted(set(slugs) - {robot.slug for robot in robots})
        if unknown:
            raise CommandError(f"There is no robot {', '.join(unknown)}.")

    def _stop_without_database(self, slugs: list[str], by: str, reason: str, error: DatabaseError) -> None:
        """Stop whatever listens on this computer: only the database knows names, and robots elsewhere."""
        if slugs:
            raise CommandError(
                f"The database does not answer, so no robot is known by name ({error}). Say --all."
            )
        sockets = sorted(settings.FLEET_RUN_DIR.glob("*.sock"))
        results = press_all([LinkAddress(unix_path=str(path)) for path in sockets], by, reason)
        for path, result in zip(sockets, results, strict=True):
            self.stdout.write(f"{path.name}: {_told(result)}")
        stopped = sum(isinstance(result, Stopped) for result in results)
        raise CommandError(
            f"The database does not answer ({error}). Every bridge on this computer was told: {stopped} robots are "
            f"stopping, {len(results) - stopped} did not answer. Nothing was recorded, and bridges on other computers "
            "were not reached. Use the red button on the other robots."
        )

    def _record(self, robot: Robot, reason: str, result: Stopped | Refusal) -> None:
        pressed = record_press(robot.id, actor=here(), through="command line", reason=reason)
        record_outcome(pressed, actor=here(), result=result)
        if pressed is None:
            self.stderr.write(f"{robot.slug}: not recorded, see the log")


def _who() -> str:
    """The account that presses; one that has no name presses all the same."""
    try:
        return _clean(getpass.getuser())[:100]
    except (KeyError, OSError):
        return f"uid {os.getuid()}"


def _clean(text: str) -> str:
    """What can be sent of a text from a terminal, which may be in any encoding."""
    return text.encode(errors="replace").decode()[:200]


def _told(result: Stopped | Refusal) -> str:
    return result.text if isinstance(result, Refusal) else "stopping"
