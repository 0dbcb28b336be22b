"""Notifications of bookings: stored with the change that they report, shown on the pages, sent by e-mail and push.

Several housekeeping processes may run: each claims a notification before it sends it. If a process dies
before it has sent the notification, or the mail server does not answer or does not take it, it is tried again after
`AGAIN`, and given up after `GIVEN_UP`. If the mail server refuses the address, it is not tried again.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Collection, Iterable
from contextlib import suppress
from datetime import datetime, timedelta
from email.mime.text import MIMEText
from functools import partial
from typing import Any
from uuid import UUID
from zoneinfo import ZoneInfo

from django.core.mail import EmailMessage, get_connection
from django.db import IntegrityError, transaction
from django.db.models import F, Q, QuerySet
from django.dispatch import Signal, receiver
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import override

from fleet.accounts import emails
from fleet.accounts.models import User
from fleet.accounts.services import erased
from fleet.base.formats.dates import dated
from fleet.base.languages import of_person
from fleet.base.zones import zone_of
from fleet.bookings.lessons.members import sharers_of
from fleet.bookings.messages.events import details_of, message_about
from fleet.bookings.models import Booking, BookingMember, FeedAddress, Notification, State, Turn, Waiting

log = logging.getLogger(__name__)

Words = Callable[[], str]

# Sent in the transaction that stores a notification; argument: notification. `teleop.push` then pushes it.
notification_written = Signal()

SOON = timedelta(days=7)  # of later lessons, people read in their calendars that they moved
AHEAD = timedelta(hours=1)  # how long before its slot a reminder is sent
AGAIN = timedelta(minutes=5)
GIVEN_UP = timedelta(days=1)
BATCH_SIZE = 20  # notifications that are sent in one round
ROUND_S = 30.0  # a slow mail server ends a round: other housekeeping must not wait
SHOWN = timedelta(days=7)
MOST_SHOWN = 3
KEPT = timedelta(days=30)


def notification_write(
    *,
    to: User,
    subject: str,
    text: str,
    now: datetime,
    about: Iterable[Booking] = (),
    gone: bool = False,
    later: bool = False,
) -> None:
    """Store a notification, in the caller's transaction.

    Without an e-mail address, it is only shown on pages. `about`: its e-mail has room, purpose and link of these
    bookings, and messages for the person's calendar program. `gone`: the person has them no longer.
    `later`: these follow after the commit, because others wait for the caller's locks; until then it is not sent.
    """
    notification = Notification(person=to, subject=subject[:200], text=text, made_at=now)
    enclose = partial(_enclose, notification, list(about), gone=gone)
    if to.email and later:
        notification.claimed_at = now
        transaction.on_commit(partial(_enclosed_later, notification, enclose), robust=True)
    elif to.email:
        enclose()
    _store(notification)


def _enclose(notification: Notification, bookings: list[Booking], *, gone: bool) -> None:
    to, now = notification.person, notification.made_at
    with override(of_person(to.language)):
        notification.details = "\n\n".join(filter(None, map(details_of, bookings)))
        notification.calendar = [message_about(one, to, now, gone=gone) for one in bookings]


def _enclosed_later(notification: Notification, enclose: Callable[[], None]) -> None:
    enclose()
    notification.claimed_at = None
    notification.save(update_fields=["details", "calendar", "claimed_at"])


def passing_write(
    *, to: User, subject: str, text: str, now: datetime, path: str, until: datetime, key: str | None = None
) -> None:
    """Store a notification about a moment; one with a `key` once, whichever process is first.

    It is shown on pages and pushed, but not e-mailed.
    """
    if key is not None and Notification.objects.filter(key=key).exists():
        return
    facts = {"subject": subject[:200], "text": text, "path": path, "until": until, "key": key}
    with suppress(IntegrityError), transaction.atomic():  # another process wrote it meanwhile
        _store(Notification(person=to, made_at=now, **facts))


def _store(notification: Notification) -> None:
    notification.save()
    notification_written.send(Notification, notification=notification)


def notifications_unseen(people: Collection[UUID], now: datetime) -> dict[UUID, list[Notification]]:
    """Return people's newest unseen notifications: at most `MOST_SHOWN` of each, none older than `SHOWN`."""
    unseen = Notification.objects.filter(person__in=people, seen_at=None, made_at__gt=now - SHOWN)
    found: dict[UUID, list[Notification]] = {person: [] for person in people}
    for one in unseen.filter(Q(until=None) | Q(until__gt=now)).order_by("-made_at", "-pk"):
        if len(found[one.person_id]) < MOST_SHOWN:
            found[one.person_id].append(one)
    return found


def notifications_seen(person: User, newest: int, now: datetime) -> None:
    """Note that a person has seen their notifications up to this one."""
    Notification.objects.filter(person=person, seen_at=None, pk__lte=newest).update(seen_at=now)


def remove_old_notifications(now: datetime) -> None:
    """Remove notifications after `KEPT`."""
    Notification.objects.filter(made_at__lt=now - KEPT).delete()


@receiver(erased)
def _forget(*, user: User, **_options: Any) -> None:
    """Remove an erased person's notifications, places in lines and teams, and feeds. Bookings stay, without purpose."""
    for table in (Notification, Waiting, FeedAddress, BookingMember, Turn):
        table.objects.filter(person=user).delete()
    Booking.objects.filter(person=user).update(purpose="")


def changed_by_another(
    booking: Booking,
    actor: User | None,
    what: Words,
    now: datetime,
    reason: Words = str,
    *,
    gone: bool = False,
    times: bool = False,
) -> None:
    """Notify the owner of a booking that another person, or the console, changed it.

    `gone`: the owner has it no longer. `times`: its times changed, or it was cancelled. If it begins soon, the people
    who share it are notified, too. `what` and `reason` are called in the reader's language and time zone.
    """
    readers = [booking.person]
    if times and booking.shared and booking.starts_at < now + SOON:
        readers += sharers_of([booking])[booking.pk]
    for reader in readers:
        if actor is None or actor.pk != reader.pk:
            _changed(booking, reader, actor, what, now, reason, gone=gone)


def _changed(
    booking: Booking,
    reader: User,
    actor: User | None,
    what: Words,
    now: datetime,
    reason: Words,
    *,
    gone: bool,
) -> None:
    zone = zone_of(reader.time_zone)
    with override(of_person(reader.language)), timezone.override(zone):
        by = actor.display_name if actor else _("the console")
        subject = _("Your booking of %(robot)s: %(what)s") % {"robot": booking.robot.name, "what": what()}
        lines = [
            in_words(booking, zone),
            _("Changed by %(name)s.") % {"name": by},
            reason(),
        ]
    text = "\n".join(lines).strip()
    notification_write(to=reader, subject=subject, text=text, now=now, about=[booking], gone=gone)


def in_words(booking: Booking, zone: ZoneInfo) -> str:
    """Return a text with the robot and the times of a booking, in this zone."""
    starts = dated(booking.starts_at.astimezone(zone), "D d M Y, H:i")
    times = f"{starts} - {dated(booking.ends_at.astimezone(zone), 'H:i')} ({zone.key})"
    return f"{booking.robot.name}, {times}"


def write_reminders(now: datetime) -> None:
    """Write a reminder for each slot that begins within an hour and was booked before that hour."""
    due = Booking.objects.filter(
        state=State.BOOKED, reminded_at=None, starts_at__gt=now, starts_at__lte=now + AHEAD
    )
    for booking in due.filter(made_at__lt=F("starts_at") - AHEAD).select_related("person", "robot"):
        with transaction.atomic():  # if the process dies here, the reminder is written in the next round
            if Booking.objects.filter(pk=booking.pk, reminded_at=None).update(reminded_at=now):
                with override(of_person(booking.person.language)):
                    subject = _("%(robot)s is yours soon") % {"robot": booking.robot.name}
                    words = in_words(booking, zone_of(booking.person.time_zone))
                notification_write(to=booking.person, subject=subject, text=words, now=now, about=[booking])


def email_of(notification: Notification) -> EmailMessage:
    """Return the e-mail of a notification, with its bookings for the person's calendar program."""
    text = "\n\n".join(filter(None, [notification.text, notification.details]))
    message = EmailMessage(notification.subject, text, to=[notification.person.email])
    for number, entry in enumerate(notification.calendar or ()):
        part = MIMEText(entry["text"], "calendar", "utf-8")
        part.set_param("method", entry["method"])
        name = f"booking-{number + 1}.ics" if number else "booking.ics"
        part.add_header("Content-Disposition", "attachment", filename=name)
        message.attach(part)
    return message


def _unsent(now: datetime) -> QuerySet[Notification]:
    unsent = Notification.objects.filter(until=None, sent_at=None, made_at__gt=now - GIVEN_UP)
    return unsent.exclude(person__email="")


def unsent_since(now: datetime) -> datetime | None:
    """Return when the oldest notification was made whose e-mail is still to be sent; None: all are sent."""
    return _unsent(now).order_by("made_at").values_list("made_at", flat=True).first()


def send_notifications(now: datetime) -> int:
    """Send waiting notifications, at most `BATCH_SIZE`. Return how many are over: sent, or to a wrong address."""
    waiting = _unsent(now).filter(Q(claimed_at=None) | Q(claimed_at__lt=now - AGAIN))
    waiting = waiting.select_related("person").order_by("made_at")[:BATCH_SIZE]
    connection, sent, until_s = get_connection(timeout=emails.SERVER_TIMEOUT_S), 0, time.monotonic() + ROUND_S
    for notification in waiting:
        if time.monotonic() > until_s:
            break
        mine = Notification.objects.filter(
            pk=notification.pk, claimed_at=notification.claimed_at, sent_at=None
        )
        if not mine.update(claimed_at=now):
            continue
        message = email_of(notification)
        try:
            delay = emails.put_off(message, connection)
        except OSError as error:  # also SMTPException
            log.warning("The mail server takes no e-mail now; all wait and are tried again: %s", error)
            break
        if delay:  # other notifications must not wait for this one
            log.warning(
                "An e-mail to %s was put off and is tried again in 5 minutes: %s",
                notification.person_id,
                delay,
            )
            continue
        Notification.objects.filter(pk=notification.pk).update(sent_at=now)
        sent += 1
    with suppress(OSError):
        connection.close()
    return sent
