"""``manage.py run_housekeeping``: what needs a clock. Every second, in small transactions.

Any number of these may run: each step is a conditional change, and whoever comes second finds nothing to do.
Ends on SIGTERM, SIGINT, and when its standard input closes: the supervisor that started it is gone then.
"""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

from django.core.management import call_command
from django.core.management.base import BaseCommand, CommandParser
from django.db import DatabaseError, close_old_connections
from django.utils import timezone

from fleet.audit import AuditUnavailable, retention
from robots.processes.shutdown import told_to_end
from robots.recording.faults import RobotWatch
from teleop.control import rules, services
from teleop.control.selectors import held_leases
from teleop.recording import camera_audit
from teleop.reports import session_maps

log = logging.getLogger(__name__)

EVERY_S = 1.0
END_S = 4.0  # from being told to end, even while the database hangs
DAY_S = 24 * 60 * 60.0
AGAIN_S = 60 * 60.0  # after a day's chores have failed
SET_S = 60 * 60.0  # by less nobody means another day
CHORES_S = 0.2  # of each round: leases end in time whatever there is to clear away


class Command(BaseCommand):
    """The housekeeper."""

    help = (
        "Ends leases and questions whose time is over, and records when a robot goes and comes back; once a day "
        "forgets old sign-in sessions, what the audit log keeps no longer, and maps that no path is shown on."
    )

    def add_arguments(self, parser: CommandParser) -> None:
        """How often."""
        parser.add_argument("--once", action="store_true", help="one round, then exit")

    def handle(self, *args: Any, **options: Any) -> None:
        """Go round until told to end."""
        if options["once"]:
            go_round()
            for _ in chores():
                pass
            return
        over = told_to_end(sys.stdin.fileno(), END_S)
        daily, robots = Daily(), RobotWatch()
        while not over.wait(EVERY_S):
            try:
                go_round()
                robots.step(time.monotonic())
                daily.a_little()
            except (DatabaseError, AuditUnavailable) as error:
                log.error("housekeeping failed, and is tried again: %s", error)
            close_old_connections()


class Daily:
    """The chores of a day, begun at once, every day, and when the clock was set; a little in each round."""

    def __init__(self) -> None:
        self._due_s = time.monotonic()
        self._set_s = _clock_ahead_s()
        self._steps: Iterator[None] = iter(())

    def a_little(self) -> None:
        """Go on with them for a moment. If a step fails, they are begun again later."""
        now_s = time.monotonic()
        if now_s >= self._due_s or abs(_clock_ahead_s() - self._set_s) > SET_S:
            self._steps, self._due_s, self._set_s = chores(), now_s + DAY_S, _clock_ahead_s()
        try:
            while time.monotonic() < now_s + CHORES_S:
                next(self._steps)
        except StopIteration:
            return
        except (DatabaseError, AuditUnavailable):
            self._due_s = now_s + AGAIN_S
            raise


def _clock_ahead_s() -> float:
    """By how much the clock is ahead of the one that nobody sets."""
    return time.time() - time.monotonic()


def chores() -> Iterator[None]:
    """What is due once a day, step by step."""
    call_command("clearsessions")
    yield
    now = timezone.now()
    yield from camera_audit.close_abandoned(now)
    yield from retention.keep_house(now)
    if not retention.clock_is_doubted(now.date()):
        yield from session_maps.keep_house(now)


def go_round() -> None:
    """End what is over now."""
    now = timezone.now()
    for robot_id, lease in held_leases():
        if rules.lapse_reason(lease, now) is not None:
            with suppress(services.ControlRefused):  # somebody else was faster, or it is tried again
                services.lease_expire(robot_id=robot_id, now=now)
    services.requests_lapse(now=now)
