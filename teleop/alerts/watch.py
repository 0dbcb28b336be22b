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
from fleet.audit.errors import AuditUnavailable, cause_of
from robots.shared.sentences import Sentence, say
from teleop.alerts import checks, telling
from teleop.alerts.checks import Trouble
from teleop.alerts.rules import rules
from teleop.models import Alert, AlertRule

log = logging.getLogger(__name__)

EVERY_S = 15.0
UNSEEN = timedelta(seconds=60)  # longer than the slowest round
KEPT = timedelta(days=90)
FOUND = timedelta(minutes=2)  # so long after a letter the mail server is found to take none
OVER_WAITS = timedelta(days=7)  # later nobody wants a letter that something is over
DATABASE_S = 60.0  # away for so long, it needs somebody
STALE_S = 120.0  # after the last look, nobody knows what needs somebody; longer than a round over many silent bridges

_looked_s: float | None = None  # when this process looked last, or began to


def look_age_s() -> float | None:
    """Return how long ago (s) this process looked; None: it does not look."""
    return None if _looked_s is None else time.monotonic() - _looked_s


def knows() -> bool:
    """Return whether this process has looked lately, so that the stored alerts are what needs somebody now."""
    age_s = look_age_s()
    return age_s is not None and age_s < STALE_S


class AlertWatch:
    """Looks every `EVERY_S` in a thread of its own."""

    def __init__(self) -> None:
        self._checks: dict[tuple[str, ...], Callable[[], Iterator[Trouble]]] = {
            ("robot", "bridge", "watchdog"): checks.robots,
            ("supervisor",): checks.supervisor,
            ("redis",): checks.redis,
            ("database",): checks.database,
            ("mail",): checks.mail,
            ("disk",): checks.disk,
            ("store",): checks.store,
            ("backup",): checks.backup,
            ("certificate",): checks.Certificates(),
        }
        self._without = WithoutDatabase()
        self._has_begun = False

    def start(self) -> None:
        """Look from now on, until the process ends."""
        _has_looked()
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
            _has_looked()
            self._without.is_back()
        except (DatabaseError, AuditUnavailable) as error:
            log.error("Alerts wait for the database: %s", error)
            self._without.is_away(time.monotonic(), error)
        finally:
            close_old_connections()

    def look(self, now: datetime) -> None:
        """Run all checks; store what began and what is over; tell what is due."""
        Alert.objects.filter(over_at__lt=now - KEPT).delete()
        if not self._has_begun:
            _write_again()
            self._has_begun = True
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
            try:
                _tell_due(alert, known[alert.kind], now)
            except (DatabaseError, AuditUnavailable):
                raise
            except Exception:  # a fault of one alert must not silence the others
                log.exception("An alert of the kind %s cannot be told.", alert.kind)
        waiting = Alert.objects.filter(over_at__gt=now - OVER_WAITS, mails__gt=0, mailed_at=None)
        for alert in waiting.select_related("robot").order_by("over_at"):
            _mail(alert, known[alert.kind], "over", now)

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


def _write_again() -> None:
    """Write again what waited for the mail server in a process that has ended, such as for other settings."""
    if (mail := Alert.objects.filter(kind="mail", over_at=None).order_by("began_at").first()) is not None:
        waited = Alert.objects.filter(mails__gt=0, mailed_at__gte=mail.began_at - FOUND)
        waited.update(mailed_at=None, mails=F("mails") - 1)


def _has_looked() -> None:
    global _looked_s
    _looked_s = time.monotonic()


def _end(alert: Alert, now: datetime) -> None:
    """Store that it was over when it was last found; a letter goes to those who were told that it began."""
    mine = Alert.objects.filter(pk=alert.pk, over_at=None, seen_at=alert.seen_at)
    with transaction.atomic():
        if not mine.update(over_at=min(alert.seen_at, now), mailed_at=None):
            return
        alert.refresh_from_db()  # another process may just have told it
        if alert.told_at is not None:
            telling.record_of(alert, "over")


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
    if alert.mailed_at is None:
        _mail(alert, rule, "still" if alert.mails else "begin", now)


def _mail(alert: Alert, rule: AlertRule, what: str, now: datetime) -> None:
    """Write the letters, once; they wait for the end of quiet times, or for a mail server."""
    if not telling.may_mail(rule, now):
        return
    with transaction.atomic():
        mine = Alert.objects.filter(pk=alert.pk, over_at=alert.over_at, mailed_at=None)
        if mine.update(mailed_at=now, mails=F("mails") + 1):
            telling.mail(alert, rule, what)


def _due(alert: Alert, rule: AlertRule, now: datetime) -> str:
    """Return what is to be recorded now; may be empty."""
    if alert.told_at is None:
        return "begin"
    return "still" if rule.again_h and abs(now - alert.told_at) >= timedelta(hours=rule.again_h) else ""


class WithoutDatabase:
    """Tells by e-mail that the database cannot be used: nothing can be stored then, so each process tells it."""

    def __init__(self) -> None:
        self._since_s: float | None = None
        self._told: Sentence | None = None
        self._to: list[telling.Reader] = []

    def know(self, rule: AlertRule) -> None:
        """Keep whom to tell, while the database knows it."""
        self._to = telling.readers(rule) if rule.active and rule.mail else []

    def is_away(self, now_s: float, error: Exception) -> None:
        """The database cannot be used (s, monotonic)."""
        self._since_s = now_s if self._since_s is None else self._since_s
        if self._told is None and now_s - self._since_s >= DATABASE_S:
            cause = cause_of(error.__cause__ or error)[1]
            self._told = say("Robots stand, because nothing can be recorded: {cause}.", cause=cause)
            emails.send_at_once(telling.written(self._to, self._told, "begin"))

    def is_back(self) -> None:
        """The database can be used again."""
        if self._told is not None:
            emails.send_at_once(telling.written(self._to, self._told, "over"))
        self._since_s = self._told = None
