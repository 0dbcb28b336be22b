"""``manage.py run_housekeeping``: what needs a clock. Every second, in small transactions.

Any number of these may run: each step is a conditional change, and whoever comes second finds nothing to do.
Ends on SIGTERM, SIGINT, and when its standard input closes: the supervisor that started it is gone then.
"""

from __future__ import annotations

import logging
import sys
import time
from contextlib import suppress
from typing import Any

from django.core.management import call_command
from django.core.management.base import BaseCommand, CommandParser
from django.db import DatabaseError, close_old_connections
from django.utils import timezone

from robots.ending import told_to_end
from teleop import rules, services
from teleop.selectors import held_robots

log = logging.getLogger(__name__)

EVERY_S = 1.0
END_S = 4.0  # from being told to end, even while the database hangs
CLEAR_SESSIONS_S = 24 * 60 * 60.0


class Command(BaseCommand):
    """The housekeeper."""

    help = "Ends leases and questions whose time is over, and forgets old sign-in sessions."

    def add_arguments(self, parser: CommandParser) -> None:
        """How often."""
        parser.add_argument("--once", action="store_true", help="one round, then exit")

    def handle(self, *args: Any, **options: Any) -> None:
        """Go round until told to end."""
        if options["once"]:
            go_round()
            return
        over = told_to_end(sys.stdin.fileno(), END_S)
        sessions_due_s = time.monotonic()
        while not over.wait(EVERY_S):
            try:
                go_round()
                if time.monotonic() >= sessions_due_s:
                    call_command("clearsessions")
                    sessions_due_s = time.monotonic() + CLEAR_SESSIONS_S
            except DatabaseError as error:
                log.error("housekeeping failed, and is tried again: %s", error)
            close_old_connections()


def go_round() -> None:
    """End what is over now."""
    now = timezone.now()
    for robot_id, holding in held_robots():
        if rules.lapse(holding, now) is not None:
            with suppress(services.ControlRefused):  # somebody else was faster, or it is tried again
                services.lease_expire(robot_id=robot_id, now=now)
    services.asks_lapse(now=now)
