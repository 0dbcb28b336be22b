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

from fleet.audit import AuditUnavailable, record
from robots.bridge.config import LinkAddress
from robots.link import LinkRefused, stop_once
from robots.models import Robot
from robots.selectors import link_address


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
        outcomes = stop([link_address(robot) for robot in robots], by, reason)
        for robot, failure in zip(robots, outcomes, strict=True):
            self._record(robot, by, reason, failure)
            self.stdout.write(f"{robot.slug}: {failure or 'stopping'}")
        unreached = [robot.slug for robot, failure in zip(robots, outcomes, strict=True) if failure]
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
        outcomes = stop([LinkAddress(unix_path=str(path)) for path in sockets], by, reason)
        for path, failure in zip(sockets, outcomes, strict=True):
            self.stdout.write(f"{path.name}: {failure or 'stopping'}")
        stopped = outcomes.count("")
        raise CommandError(
            f"The database does not answer ({error}). Every bridge on this computer was told: {stopped} robots are "
            f"stopping, {len(outcomes) - stopped} did not answer. Nothing was recorded, and bridges on other computers "
            "were not reached. Use the red button on the other robots."
        )

    def _record(self, robot: Robot, by: str, reason: str, failure: str) -> None:
        """Afterwards: a stop waits for nothing and is never refused."""
        try:
            record(
                "stop.press",
                robot_id=robot.id,
                robot_name=robot.name,
                outcome=f"not reached: {failure}"[:200] if failure else "stopping",
                parameters={"by": by, "reason": reason},
            )
        except (AuditUnavailable, DatabaseError) as error:
            self.stderr.write(f"{robot.slug}: not recorded: {error}")


def stop(addresses: Sequence[LinkAddress], by: str, reason: str) -> list[str]:
    """Press everywhere at once; returns why each was not reached, "" if it was."""
    with ThreadPoolExecutor(max(len(addresses), 1)) as pool:
        return list(pool.map(lambda address: _stop_one(address, by, reason), addresses))


def _stop_one(address: LinkAddress, by: str, reason: str) -> str:
    try:
        stop_once(address, by, reason)
    except LinkRefused as error:
        return error.refusal.text
    return ""
