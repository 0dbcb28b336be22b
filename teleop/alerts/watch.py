"""Looks for troubles, stores them, and tells them by the rules.

Several processes may: each step is a conditional change. They do not all see the same: a full disk only its own
computer. So a trouble is over when no process has found it for `UNSEEN`.
It runs in the pages process of every web process, which lives on when a supervisor or a bridge host does not.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator
from datetime import datetime, timedelta

from django.db import DatabaseError, IntegrityError, close_old_connections, transaction
from django.db.models import F
from django.utils import timezone

from fleet.accounts import emails
from fleet.audit.errors import AuditUnavailable
from robots.shared.sentences import say
from teleop.alerts import checks, telling
from teleop.alerts.checks import Trouble
from teleop.alerts.rules import rules
from teleop.models import Alert, AlertRule

log = logging.getLogger(__name__)

EVERY_S = 15.0
UNSEEN = timedelta(seconds=60)  # longer than the slowest round
KEPT = timedelta(days=90)
DATABASE_S = 60.0  # away for so long, it needs somebody


class AlertWatch:
    """Looks every `EVERY_S` in a thread of its own."""

    def __init__(self) -> None:
        self._checks: dict[tuple[str, ...], Callable[[], Iterator[Trouble]]] = {
            ("robot", "bridge", "watchdog"): checks.robots,
            ("supervisor",): checks.supervisor,
            ("redis",): checks.redis,
            ("database",): checks.database,
            ("disk",): checks.disk,
            ("backup",): checks.backup,
            ("certificate",): checks.Certificates(),
        }
        self._without = WithoutDatabase()

    def start(self) -> None:
        """Look from now on, until the process ends."""
        threading.Thread(target=self._run, name="alerts", daemon=True).start()

    def _run(self) -> None:
        while True:
            time.sleep(EVERY_S)
            try:
                self._round()
            except Exception:
                log.exception("A round of alerts failed and is tried again.")

    def _round(self) -> None:
        try:
            self.look(timezone.now())
            self._without.is_back()
        except (DatabaseError, AuditUnavailable) as error:
            log.error("Alerts wait for the database: %s", error)
            self._without.is_away(time.monotonic())
        finally:
            close_old_connections()

    def look(self, now: datetime) -> None:
        """Run all checks; store what began and what is over; tell what is due."""
        Alert.objects.filter(over_at__lt=now - KEPT).delete()
        for kinds, check in self._checks.items():
            try:
                found = list(check())
            except DatabaseError:
                raise
            except Exception:  # a fault of one check must not silence the others
                log.exception("The check of %s failed.", ", ".join(kinds))
            else:
                self._settle(kinds, found, now)
        known = rules()
        self._without.know(known["database"])
        for alert in Alert.objects.filter(over_at=None).select_related("robot"):
            _tell_due(alert, known[alert.kind], now)

    def _settle(self, kinds: tuple[str, ...], found: list[Trouble], now: datetime) -> None:
        still = Alert.objects.filter(kind__in=kinds, over_at=None)
        known = {(one.kind, one.subject): one for one in still}
        for trouble in found:
            said = trouble.words.parts
            if (alert := known.pop((trouble.kind, trouble.subject), None)) is not None:
                Alert.objects.filter(pk=alert.pk, over_at=None).update(seen_at=now, said=said)
                continue
            try:
                with transaction.atomic():
                    Alert.objects.create(
                        kind=trouble.kind,
                        subject=trouble.subject,
                        robot=trouble.robot,
                        said=said,
                        began_at=now,
                        seen_at=now,
                    )
            except IntegrityError:
                continue  # another process has stored it
        for alert in known.values():
            if abs(now - alert.seen_at) >= UNSEEN:  # later: the clock was set back
                _end(alert, now)


def _end(alert: Alert, now: datetime) -> None:
    """Store that it was over when it was last found, and tell it to those who were told that it began."""
    mine = Alert.objects.filter(pk=alert.pk, over_at=None, seen_at=alert.seen_at)
    with transaction.atomic():
        if not mine.update(over_at=min(alert.seen_at, now)):
            return
        alert.refresh_from_db()  # another process may just have told it
        if alert.told_at is not None:
            telling.tell(alert, rules()[alert.kind], "over")


def _tell_due(alert: Alert, rule: AlertRule, now: datetime) -> None:
    """Tell what is due. A step that fails is not stored, and is tried again in the next round.

    A time that is ahead was stored before the clock was set back.
    """
    if not rule.active or abs(alert.seen_at - alert.began_at) < timedelta(minutes=rule.after_min):
        return
    mine = Alert.objects.filter(pk=alert.pk, over_at=None)
    if what := _due(alert, rule, now):
        with transaction.atomic():
            if not mine.filter(told_at=alert.told_at).update(told_at=now, mailed_at=None):
                return  # another process was quicker
            alert.mailed_at = None
            telling.record_of(alert, what)
    if alert.mailed_at is not None or not telling.may_mail(rule, now):
        return  # a letter waits for the end of quiet times, or for a mail server
    with transaction.atomic():
        if mine.filter(mailed_at=None).update(mailed_at=now, mails=F("mails") + 1):
            telling.mail(alert, rule, "still" if alert.mails else "begin")


def _due(alert: Alert, rule: AlertRule, now: datetime) -> str:
    """Return what is to be recorded now; may be empty."""
    if alert.told_at is None:
        return "begin"
    return "still" if rule.again_h and abs(now - alert.told_at) >= timedelta(hours=rule.again_h) else ""


class WithoutDatabase:
    """Tells by e-mail that the database is away: nothing can be stored then, so each process tells it."""

    def __init__(self) -> None:
        self._since_s: float | None = None
        self._told = False
        self._to: list[telling.Reader] = []

    def know(self, rule: AlertRule) -> None:
        """Keep whom to tell, while the database knows it."""
        self._to = telling.readers(rule) if rule.active and rule.mail else []

    def is_away(self, now_s: float) -> None:
        """The database does not answer (s, monotonic)."""
        self._since_s = now_s if self._since_s is None else self._since_s
        if not self._told and now_s - self._since_s >= DATABASE_S:
            self._told = True
            self._tell("begin")

    def is_back(self) -> None:
        """The database answers."""
        if self._told:
            self._tell("over")
        self._since_s, self._told = None, False

    def _tell(self, what: str) -> None:
        words = say("The database does not answer: robots stand.")
        emails.send_at_once(telling.written(self._to, words, what))
