"""``manage.py run_fleet [SLUG ... | --host NAME]``: run the fleet supervisor until a signal ends it."""

from __future__ import annotations

from typing import Any

from django.core.management.base import BaseCommand, CommandError, CommandParser

from fleet.base.database.schema import begin
from robots.link.stop_courier import courier
from robots.registry.models import Robot
from robots.shared.processes.one_supervisor import AlreadySupervised
from robots.shared.processes.shutdown import EXIT_ALREADY_RUNNING
from robots.supervisor.claims import sole_supervisor
from robots.supervisor.fleet_supervisor import Fleet, Stopping, supervise, wait_shortly


class Command(BaseCommand):
    help = "Run a bridge for every enabled robot, and the housekeeping."

    def add_arguments(self, parser: CommandParser) -> None:
        parser.add_argument(
            "slugs", nargs="*", metavar="SLUG", help="only these robots, for one of several hosts"
        )
        parser.add_argument(
            "--host",
            default="",
            help="only the robots whose bridge address has this host, and no housekeeping",
        )

    def handle(self, *args: Any, **options: Any) -> None:
        begin("supervisor")
        wait_shortly()
        only = frozenset(options["slugs"])
        unknown = only - set(Robot.objects.values_list("slug", flat=True))
        if unknown:
            raise CommandError(f"There is no robot {', '.join(sorted(unknown))}.")
        stopping = Stopping()
        try:
            with sole_supervisor():
                fleet = Fleet(only, host=options["host"])
                fleet.claim()
                courier().start(stays=True)
                supervise(fleet, stopping)
        except AlreadySupervised as other:
            what = "one of these robots" if only else options["host"] or "this console"
            raise CommandError(
                f"A supervisor runs {what} already: {other}. It goes on, and this one ends. Two cannot run the same "
                "robots: end one of them, or make this computer a bridge host of other robots.",
                returncode=EXIT_ALREADY_RUNNING,
            ) from other
