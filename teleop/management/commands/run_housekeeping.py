"""``manage.py run_housekeeping``: work that depends on the clock. Every second, in small transactions.

Several of these processes may run in parallel: each step is a conditional change, so the second process finds
nothing to do. The process ends on SIGTERM, on SIGINT, and when its standard input closes, because then the
fleet supervisor that started it has ended.
"""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from datetime import timedelta
from typing import Any

from django.core.management import call_command
from django.core.management.base import BaseCommand, CommandParser
from django.db import DatabaseError, close_old_connections
from django.utils import timezone

from fleet.accounts.erasing import erase_next
from fleet.accounts.tokens.services import remove_expired_tokens
from fleet.audit import retention
from fleet.audit.errors import AuditUnavailable
from fleet.base.database.schema import begin
from fleet.bookings.changes import waiting_list as waiting
from fleet.bookings.changes.handing import hand_offers_lapse, remove_old_offers
from fleet.bookings.losses import lost_rights
from fleet.bookings.losses.weighing import remove_old_changes
from fleet.bookings.messages import moments, notifications
from fleet.bookings.services import BookingRefused, remove_old_cancelled, restore_unbegun, store_no_shows
from robots.recordings import retention as recording_retention
from robots.records.faults import RobotWatch
from robots.shared.processes.shutdown import end_event
from teleop.api.v1.framework.idempotency import remove_old_answers
from teleop.control import lease_checks, services
from teleop.control.changes import ControlRefused
from teleop.control.database_watch import DatabaseWatch
from teleop.control.selectors import held_leases
from teleop.control.waiting import line
from teleop.control.waiting.turns import turns_settle_all
from teleop.push.worker import PushWorker
from teleop.recordings import downloads
from teleop.recordings.orders.by_hand import HandRecordings
from teleop.recordings.orders.of_bookings import BookingRecorder
from teleop.records import camera_audit
from teleop.reports import session_maps
from teleop.webhooks.delivery import remove_old_deliveries
from teleop.webhooks.worker import WebhookWorker

log = logging.getLogger(__name__)

EVERY_S = 1.0
END_S = 4.0  # from the signal to the end of the process, even while the database hangs
RIGHTS_S = 5 * 60.0  # between two searches for bookings of people without the right to book
SWEPT_S = 60 * 60.0  # between two looks for old downloads
NOTED_S = 20.0  # between two searches for unused bookings, and for offers that nobody answered
CLOCK_S = 60.0  # a larger change of the clock's lead begins a new watch; small ones are its correction
DAY_S = 24 * 60 * 60.0
AGAIN_S = 60 * 60.0  # pause after the daily work failed
SET_S = 60 * 60.0  # a change of the clock by more than this starts the daily work again
CHORES_S = 0.2  # of daily work per round, so that leases end in time


class Command(BaseCommand):
    """The housekeeping process."""

    help = (
        "Ends leases and requests whose time is over, and records when a robot is lost and found again. Once a day "
        "it deletes old sign-in sessions, expired parts of the audit log, expired recordings, tokens that expired long "
        "ago, and maps that no path needs."
    )
    requires_system_checks = []  # the fleet supervisor ran the checks, which load all pages

    def add_arguments(self, parser: CommandParser) -> None:
        parser.add_argument("--once", action="store_true", help="one round, then exit")

    def handle(self, *args: Any, **options: Any) -> None:
        """Repeat until the process is asked to end."""
        if options["once"]:
            end_lapsed(DatabaseWatch())
            lost_rights.bookings_free_lost(None, timezone.now())
            restore_unbegun(timezone.now())
            store_no_shows(timezone.now())
            _erase_all()
            hand_offers_lapse(timezone.now())
            downloads.remove_old()
            for _ in daily_steps():
                pass
            return
        begin("housekeeping")
        over = end_event(sys.stdin.fileno(), END_S)
        database = DatabaseWatch()
        daily, robots, webhooks, pushes = DailyWork(), RobotWatch(), WebhookWorker(), PushWorker()
        # A mail server that hangs must not delay the ends of leases, nor a long log in which a person is erased
        post, eraser = ThreadPoolExecutor(max_workers=1), ThreadPoolExecutor(max_workers=1)
        posted: Future[int] | None = None
        looked_s, noted_s, clock = float("-inf"), float("-inf"), ClockWatch()
        erased: Future[None] | None = None
        recorder, recordings = ThreadPoolExecutor(max_workers=1), RecordingWork()
        recording: Future[None] | None = None
        while not over.wait(EVERY_S):
            try:
                end_lapsed(database)
                # A process may have died before it freed the bookings
                if time.monotonic() - looked_s > RIGHTS_S:
                    lost_rights.bookings_free_lost(None, timezone.now())
                    looked_s = time.monotonic()
                if time.monotonic() - noted_s > NOTED_S:
                    restore_unbegun(timezone.now())
                    store_no_shows(timezone.now(), clock.watched())
                    hand_offers_lapse(timezone.now())
                    noted_s = time.monotonic()
                robots.step(time.monotonic())
                daily.work_a_little()
                notifications.write_reminders(timezone.now())
                moments.write_moments(timezone.now())
                waiting.keep_waiting_lists(timezone.now())
                turns_settle_all(timezone.now())
                if posted is None or posted.done():
                    posted = post.submit(_send_notifications)
                if erased is None or erased.done():
                    erased = eraser.submit(_erase)
                if recording is None or recording.done():
                    recording = recorder.submit(recordings.step)
                webhooks.step()
                pushes.step()
            except (DatabaseError, AuditUnavailable, BookingRefused) as error:
                log.error("Housekeeping failed and is tried again: %s", error)
            close_old_connections()


def _erase() -> None:
    """Erase people in a separate thread."""
    try:
        _erase_all()
    finally:
        close_old_connections()


def _erase_all() -> None:
    try:
        while erase_next(timezone.now()):
            pass
    except (DatabaseError, AuditUnavailable) as error:
        log.error("People are not erased now: %s", error)


class RecordingWork:
    """Work on recordings in a separate thread: a bridge may not answer, and a large file takes time to remove."""

    def __init__(self) -> None:
        self._bookings, self._by_hand = BookingRecorder(), HandRecordings()
        self._swept_s = float("-inf")

    def step(self) -> None:
        """Begin and end recordings of bookings, end others; each hour remove old downloads."""
        try:
            self._by_hand.step(timezone.now())
            self._bookings.step(timezone.now())
            if time.monotonic() - self._swept_s > SWEPT_S:
                self._swept_s = time.monotonic()
                downloads.remove_old()
        except (DatabaseError, AuditUnavailable, OSError) as error:
            log.error("Recordings are not begun or ended now, or old downloads stay: %s", error)
        finally:
            close_old_connections()


def _send_notifications() -> int:
    """Send e-mails in a separate thread."""
    try:
        return notifications.send_notifications(timezone.now())
    except DatabaseError as error:
        log.error("E-mails are not sent now: %s", error)
        return 0
    finally:
        close_old_connections()


class ClockWatch:
    """For how long this process has seen the clock go without being set. Nobody can set the monotonic clock."""

    def __init__(self) -> None:
        self._since_s, self._ahead_s = time.monotonic(), _clock_ahead_s()

    def watched(self) -> timedelta:
        """Return that time; it begins anew when the clock was set by more than `CLOCK_S`."""
        if abs(_clock_ahead_s() - self._ahead_s) > CLOCK_S:
            self._since_s, self._ahead_s = time.monotonic(), _clock_ahead_s()
        return timedelta(seconds=time.monotonic() - self._since_s)


class DailyWork:
    """The daily work: it starts with the process, every day, and when the clock was set.

    Each round does a part.
    """

    def __init__(self) -> None:
        self._due_s = time.monotonic()
        self._set_s = _clock_ahead_s()
        self._steps: Iterator[None] = iter(())

    def work_a_little(self) -> None:
        """Work for `CHORES_S`. If a step fails, all steps start again after `AGAIN_S`."""
        now_s = time.monotonic()
        if now_s >= self._due_s or abs(_clock_ahead_s() - self._set_s) > SET_S:
            self._steps, self._due_s, self._set_s = daily_steps(), now_s + DAY_S, _clock_ahead_s()
        try:
            while time.monotonic() < now_s + CHORES_S:
                next(self._steps)
        except StopIteration:
            return
        except (DatabaseError, AuditUnavailable):
            self._due_s = now_s + AGAIN_S
            raise


def _clock_ahead_s() -> float:
    """Return by how much the clock is ahead of the monotonic clock, which cannot be set."""
    return time.time() - time.monotonic()


def daily_steps() -> Iterator[None]:
    """Do the daily work, step by step."""
    call_command("clearsessions")
    yield
    now = timezone.now()
    yield from camera_audit.close_abandoned(now)
    notifications.remove_old_notifications(now)
    while remove_old_deliveries(now):
        yield
    remove_old_answers(now)
    remove_old_cancelled(now)
    remove_old_changes(now)
    remove_old_offers(now)
    yield from retention.remove_expired(now)
    if not retention.clock_is_doubted(now.date()):
        waiting.forget_past(now)
        remove_expired_tokens(now)
        yield from session_maps.remove_unneeded(now)
        yield from recording_retention.remove_expired(now)


def end_lapsed(database: DatabaseWatch) -> None:
    """End all leases that are over now, and remove from the lines people whose pages are closed."""
    now = timezone.now()
    held = list(held_leases())
    database.answered()
    for robot_id, lease in held:
        if lease_checks.lapse_reason(lease, now) is not None and not database.excuses(lease, now):
            with suppress(ControlRefused):  # another process was faster, or the next round tries again
                services.lease_expire(robot_id=robot_id, now=now)
    if not database.was_away:
        with suppress(ControlRefused):
            line.line_tidy(now=now)
