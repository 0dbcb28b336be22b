"""The housekeeping process: expiry and daily work without any open page."""

import os
import signal
import socket
import subprocess
import sys
import time
from datetime import timedelta
from pathlib import Path
from unittest.mock import Mock

import pytest
from django.core import mail
from django.core.management import call_command
from django.db import connection
from django.utils import timezone

from fleet.audit.models import Record
from fleet.bookings.messages import notifications
from fleet.bookings.models import Notification, Waiting
from fleet.bookings.services import BookingRefused
from robots.shared.wire import Refusal
from teleop.control import lease_checks, services
from teleop.control.database_watch import GAP_S, DatabaseWatch
from teleop.control.lease_checks import Tab
from teleop.control.selectors import lease_of
from teleop.control.waiting import line
from teleop.management.commands import run_housekeeping
from teleop.models import ControlSession, EndReason, Lease
from tests.processes import PATIENCE_S, until

pytestmark = pytest.mark.django_db(transaction=True)

MANAGE = Path(__file__).parents[3] / "manage.py"
TAB = Tab("tab", "sign-in", "connection")


@pytest.fixture
def held(robot, operator):
    """The operator has control."""
    return services.lease_take(
        robot_id=robot.id, user_id=operator.id, tab=TAB, highest_fence=0, now=timezone.now()
    )


def test_lease_of_a_lost_page_is_ended(robot, held):
    Lease.objects.update(seen_at=timezone.now() - timedelta(seconds=lease_checks.GRACE_S + 1))
    call_command("run_housekeeping", "--once")
    assert lease_of(robot.id) is None
    assert ControlSession.objects.get().end_reason == EndReason.AWAY


def test_nobody_is_gone_because_the_database_was(robot, held, second_operator):
    line.line_join(robot_id=robot.id, user_id=second_operator.id, tab=TAB, now=timezone.now())
    Lease.objects.update(seen_at=timezone.now() - timedelta(seconds=lease_checks.GRACE_S + 1))
    Waiting.objects.update(seen_at=timezone.now() - timedelta(seconds=lease_checks.WAITS_S + 1))
    database = DatabaseWatch()
    database._answered_s -= GAP_S + 1.0
    for _ in range(2):
        run_housekeeping.end_lapsed(database)
        assert lease_of(robot.id).session == held.session
        assert Waiting.objects.exists()
    database._since_s -= lease_checks.GRACE_S  # meanwhile no process stored that the page is there
    run_housekeeping.end_lapsed(database)
    assert ControlSession.objects.get().end_reason == EndReason.AWAY
    assert not Waiting.objects.exists()


def test_lease_with_its_term_over_is_ended(robot, held):
    Lease.objects.update(term_ends_at=timezone.now())
    call_command("run_housekeeping", "--once")
    assert ControlSession.objects.get().end_reason == EndReason.TERM


def test_valid_lease_is_left_alone(robot, held):
    call_command("run_housekeeping", "--once")
    assert lease_of(robot.id).session == held.session


def test_a_page_that_died_loses_its_place_in_line(robot, held, second_operator):
    line.line_join(robot_id=robot.id, user_id=second_operator.id, tab=TAB, now=timezone.now())
    Waiting.objects.update(seen_at=timezone.now() - timedelta(seconds=lease_checks.WAITS_S + 1))
    call_command("run_housekeeping", "--once")
    assert not Waiting.objects.exists()
    assert Record.objects.filter(kind="control.ask").latest("id").outcome == "gone"


def test_daily_work_runs_again_when_the_clock_was_set(monkeypatch):
    """A computer that started with a wrong clock must do the work again by the right clock."""
    begun = []
    monkeypatch.setattr(run_housekeeping, "daily_steps", lambda: iter(begun.append(time.time()) or ()))
    daily = run_housekeeping.DailyWork()
    right = time.time
    for ahead_s in (0.0, 0.0, 10.0, 1e8, 1e8, 0.0, 0.0):
        monkeypatch.setattr(time, "time", lambda ahead_s=ahead_s: right() + ahead_s)
        daily.work_a_little()
    assert len(begun) == 3


def test_bookings_that_cannot_be_freed_end_no_housekeeping(monkeypatch, robot):
    """The database may find an overlap: other work goes on."""
    rounds = iter([False, False, True])
    tried = []

    def refuse(*_):
        tried.append(1)
        raise BookingRefused([Refusal("taken", "Another person has just booked this time.", "booking")])

    monkeypatch.setattr(run_housekeeping, "end_event", lambda *_: Mock(wait=lambda _s: next(rounds)))
    monkeypatch.setattr(run_housekeeping, "begin", lambda _process: None)
    monkeypatch.setattr(run_housekeeping.lost_rights, "bookings_free_lost", refuse)
    monkeypatch.setattr(sys, "stdin", Mock())
    run_housekeeping.Command().handle(once=False)
    assert len(tried) == 2


@pytest.mark.skipif(connection.vendor != "sqlite", reason="names the test database by its file")
@pytest.mark.parametrize("how", ["terminated", "parent gone"])
def test_process_runs_until_signal_or_end_of_its_parent(how, robot, held):
    Lease.objects.update(term_ends_at=timezone.now())
    environment = os.environ | {
        "DJANGO_SETTINGS_MODULE": "fleet.settings",
        "FLEET_DATABASE_URL": f"sqlite:///{connection.settings_dict['NAME']}",
    }
    with subprocess.Popen(
        [sys.executable, MANAGE, "run_housekeeping"], stdin=subprocess.PIPE, env=environment
    ) as process:
        try:
            until(lambda: lease_of(robot.id) is None, "the lease to end")
            if how == "terminated":
                process.send_signal(signal.SIGTERM)
            else:
                process.stdin.close()
            assert process.wait(10) == 0
        finally:
            process.kill()


@pytest.mark.skipif(connection.vendor != "sqlite", reason="names the test database by its file")
def test_a_hanging_mail_server_delays_no_end_and_loses_nothing(robot, held, second_operator):
    second_operator.email = "second@lab.example"
    second_operator.save()
    notification = Notification.objects.create(
        person=second_operator, subject="Slot", text="", made_at=timezone.now()
    )
    with socket.create_server(("127.0.0.1", 0)) as server:  # accepts connections, sends nothing
        environment = os.environ | {
            "DJANGO_SETTINGS_MODULE": "fleet.settings",
            "FLEET_DATABASE_URL": f"sqlite:///{connection.settings_dict['NAME']}",
            "FLEET_EMAIL_URL": f"smtp://127.0.0.1:{server.getsockname()[1]}",
        }
        with subprocess.Popen(
            [sys.executable, MANAGE, "run_housekeeping"], stdin=subprocess.PIPE, env=environment
        ) as process:
            try:
                server.settimeout(PATIENCE_S)
                caller, _ = server.accept()
                with caller:
                    Lease.objects.update(term_ends_at=timezone.now())
                    until(lambda: lease_of(robot.id) is None, "the lease to end", 5.0)
                    process.send_signal(signal.SIGTERM)
                    process.wait(10)
            finally:
                process.kill()
    notification.refresh_from_db()
    assert (notification.sent_at, notification.claimed_at is None) == (None, False)
    later = notification.claimed_at + notifications.AGAIN + timedelta(seconds=1)
    assert notifications.send_notifications(later) == 1
    assert mail.outbox[0].subject == "Slot"
