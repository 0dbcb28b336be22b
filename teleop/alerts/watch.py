"""Looks for troubles, stores them, and tells them by the rules.

Several processes may: each step is a conditional change.
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

from fleet.audit.errors import AuditUnavailable
from robots.shared.sentences import say
from teleop.alerts import checks, telling
from teleop.alerts.checks import Trouble
from teleop.alerts.rules import rules
from teleop.models import Alert, AlertRule

log = logging.getLogger(__name__)

EVERY_S = 15.0
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
                self.look(timezone.now())
                self._without.is_back()
            except (DatabaseError, AuditUnavailable) as error:
                log.error("Alerts wait for the database: %s", error)
                self._without.is_away(time.monotonic())
            except Exception:
                log.exception("A round of alerts failed and is tried again.")
            finally:
                close_old_connections()

    def look(self, now: datetime) -> None:
        """Run all checks; store what began and what is over; tell what is due."""
        Alert.objects.filter(over_at__lt=now - KEPT).delete()
        for kinds, check in self._checks.items():
            self._settle(kinds, list(check()), now)
        known = rules()
        self._without.know(known["database"])
        for alert in Alert.objects.filter(over_at=None).select_related("robot"):
            _tell_due(alert, known[alert.kind], now)

    def _settle(self, kinds: tuple[str, ...], found: list[Trouble], now: datetime) -> None:
        still = Alert.objects.filter(kind__in=kinds, over_at=None)
        known = {(one.kind, one.subject): one for one in still}
        for trouble in found:
            if (trouble.kind, trouble.subject) in known:
                del known[trouble.kind, trouble.subject]
                continue
            try:
                with transaction.atomic():
                    Alert.objects.create(
                        kind=trouble.kind,
                        subject=trouble.subject,
                        robot=trouble.robot,
                        said=trouble.words.parts,
                        began_at=now,
                    )
            except IntegrityError:
                continue  # another process has stored it
        for over in known.values():
            if Alert.objects.filter(pk=over.pk, over_at=None).update(over_at=now) and over.told_at:
                over.over_at = now
                telling.tell(over, rules()[over.kind], "over")


def _tell_due(alert: Alert, rule: AlertRule, now: datetime) -> None:
    if not rule.active or now - alert.began_at < timedelta(minutes=rule.after_min):
        return
    mine = Alert.objects.filter(pk=alert.pk, over_at=None)
    if alert.told_at is None:
        if mine.filter(told_at=None).update(told_at=now):
            telling.record_of(alert, "begin")
    elif rule.again_h and now - alert.told_at >= timedelta(hours=rule.again_h):
        if not mine.filter(told_at=alert.told_at).update(told_at=now, mailed_at=None):
            return
        alert.mailed_at = None
        telling.record_of(alert, "still")
    if alert.mailed_at is not None or telling.is_quiet(rule, now):
        return  # a letter of quiet times waits for their end
    if mine.filter(mailed_at=None).update(mailed_at=now, mails=F("mails") + 1):
        telling.mail(alert, rule, "still" if alert.mails else "begin")


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
            telling.letters(self._to, say("The database does not answer: robots stand."), "begin")

    def is_back(self) -> None:
        """The database answers."""
        if self._told:
            telling.letters(self._to, say("The database does not answer: robots stand."), "over")
        self._since_s, self._told = None, False
