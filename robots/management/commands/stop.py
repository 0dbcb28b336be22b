"""``manage.py stop SLUG ... | --all``: press the emergency stop of robots, without web process or browser.

It does not replace a robot's red button.
"""

from __future__ import annotations

import getpass
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from django.conf import settings
from django.core.management.base import BaseCommand, CommandError, CommandParser
from django.db import DatabaseError

from robots.bridge.config import LinkAddress
from robots.link import LinkRefused, stop_once
from robots.models import Robot
from robots.selectors import link_address
from robots.stops import record_outcome, record_press
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
        by, reason = f"{getpass.getuser()} (command line)", options["reason"][:200]
        try:
            robots = list(
                Robot.objects.filter(slug__in=slugs) if slugs else Robot.objects.filter(enabled=True)
            )
        except DatabaseError as error:
            self._stop_without_database(slugs, by, reason, error)
            return
        results = stop([link_address(robot) for robot in robots], by, reason)
        for robot, result in zip(robots, results, strict=True):
            self._record(robot, by, reason, result)
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
        results = stop([LinkAddress(unix_path=str(path)) for path in sockets], by, reason)
        for path, result in zip(sockets, results, strict=True):
            self.stdout.write(f"{path.name}: {_told(result)}")
        stopped = sum(isinstance(result, Stopped) for result in results)
        raise CommandError(
            f"The database does not answer ({error}). Every bridge on this computer was told: {stopped} robots are "
            f"stopping, {len(results) - stopped} did not answer. Nothing was recorded, and bridges on other computers "
            "were not reached. Use the red button on the other robots."
        )

    def _record(self, robot: Robot, by: str, reason: str, result: Stopped | Refusal) -> None:
        parameters = {"through": "command line", "by": by, "reason": reason}
        pressed = record_press(robot.id, actor=None, parameters=parameters)
        record_outcome(pressed, actor=None, result=result)
        if pressed is None:
            self.stderr.write(f"{robot.slug}: not recorded, see the log")


def stop(addresses: Sequence[LinkAddress], by: str, reason: str) -> list[Stopped | Refusal]:
    """Press everywhere at once; returns what each bridge said, or why it was not reached."""
    with ThreadPoolExecutor(max(len(addresses), 1)) as pool:
        return list(pool.map(lambda address: _stop_one(address, by, reason), addresses))


def _stop_one(address: LinkAddress, by: str, reason: str) -> Stopped | Refusal:
    try:
        return stop_once(address, by, reason)
    except LinkRefused as error:
        return error.refusal


def _told(result: Stopped | Refusal) -> str:
    return result.text if isinstance(result, Refusal) else "stopping"
