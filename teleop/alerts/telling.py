"""Tell an alert: a record, which webhooks send (category *alerts*), and letters in each reader's language."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Any, NamedTuple

from django.core.mail import EmailMessage
from django.urls import reverse
from django.utils import timezone, translation
from django.utils.timezone import localtime
from django.utils.translation import gettext as _

from fleet.accounts import emails
from fleet.accounts.mail.off import is_off
from fleet.accounts.models import User
from fleet.audit.services import record
from fleet.base.formats.sentences import in_words
from fleet.base.languages import of_person
from fleet.base.web.origin import settled_origin
from robots.shared.sentences import Sentence
from teleop.models import Alert, AlertRule


class Reader(NamedTuple):
    """An address, and its language."""

    address: str
    language: str


def record_of(alert: Alert, what: str) -> None:
    """Record that an alert began, lasts ("still") or is over."""
    now = timezone.now()
    facts = {
        "kind": alert.kind,
        "subject": alert.subject,
        "lasted_s": round((now - alert.began_at).total_seconds()),
    }
    robot: dict[str, Any] = (
        {"robot_id": alert.robot.id, "robot_name": alert.robot.name} if alert.robot else {}
    )
    record(f"alert.{what}", parameters=facts, private={"words": alert.words}, **robot)


def mail(alert: Alert, rule: AlertRule, what: str) -> None:
    """Write letters to the rule's readers."""
    if rule.mail:
        emails.send_later(written(readers(rule), alert.words, what, alert.began_at))


def may_mail(rule: AlertRule, now: datetime) -> bool:
    """Return whether the rule's readers may get a letter now."""
    return rule.mail and not is_off() and not is_quiet(rule, now)


def readers(rule: AlertRule) -> list[Reader]:
    """Return the addresses of the rule; without any, those of all staff."""
    if named := rule.addresses:
        known = dict(User.objects.filter(email__in=named).values_list("email", "language"))
        return [Reader(one, known.get(one, "")) for one in named]
    staff = User.objects.filter(is_staff=True, is_active=True, project="").exclude(email="")
    return [Reader(one.email, one.language) for one in staff]


def written(
    to: Sequence[Reader], words: Sentence, what: str, began_at: datetime | None = None
) -> list[EmailMessage]:
    """Return a letter to each reader; none without a mail server."""
    return [] if is_off() else [_letter(one, words, what, began_at) for one in to]


def _letter(reader: Reader, words: Sentence, what: str, began_at: datetime | None) -> EmailMessage:
    with translation.override(of_person(reader.language)):
        said = in_words(words)
        subject = {"begin": "%s", "still": _("Still: %s"), "over": _("Over: %s")}[what] % said
        lines = [said]
        if began_at is not None:
            lines.append(_("Since %s.") % f"{localtime(began_at):%Y-%m-%d %H:%M %Z}")
        if what == "over":
            lines.append(_("This is over."))
        if origin := settled_origin():
            lines.append(origin + reverse("status"))
        lines.append(_("Staff choose under Status, Rules, who gets such letters, and when."))
        return EmailMessage(" ".join(subject.split())[:150], "\n\n".join(lines), to=[reader.address])


def is_quiet(rule: AlertRule, now: datetime) -> bool:
    """Return whether it is a quiet time of the rule, by the lab's clock."""
    if rule.quiet_from is None or rule.quiet_until is None:
        return False
    clock = localtime(now).time()
    if rule.quiet_from <= rule.quiet_until:
        return rule.quiet_from <= clock < rule.quiet_until
    return clock >= rule.quiet_from or clock < rule.quiet_until
