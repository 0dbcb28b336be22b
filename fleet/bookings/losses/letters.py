"""One letter for each person, also for who shares a booking, about all that a change took from them, or gave back."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from datetime import datetime
from functools import partial
from zoneinfo import ZoneInfo

from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import ngettext, override
from msgspec import Struct

from fleet.accounts.models import User
from fleet.base.languages import of_person
from fleet.base.zones import zone_of
from fleet.bookings.lessons.members import sharers_of
from fleet.bookings.losses.collecting import Actor, Loss
from fleet.bookings.messages.notifications import Words, in_words, notification_write
from fleet.bookings.models import Booking, Turn


class Line(Struct):
    """A line of a letter. Its texts are called in the reader's language."""

    booking: Booking
    what: Words
    why: Words = str
    turn: Turn | None = None  # it is about this person's turn alone


def write_losses(losses: Iterable[Loss], actor: Actor, now: datetime) -> None:
    """Tell each person what a change of another person took from them."""
    lines = [Line(one.booking, partial(str, one.how.label), one.why, one.turn) for one in losses]
    _write(lines, actor, now, _taken)


def write_given_back(bookings: Iterable[Booking], turns: Iterable[Turn], actor: Actor, now: datetime) -> None:
    """Tell each person which bookings and turns are theirs again."""
    lines = [Line(one, lambda: _("given back")) for one in bookings]
    lines += [Line(one.booking, lambda: _("given back"), turn=one) for one in turns]
    _write(lines, actor, now, _given_back)


def _taken(count: int) -> str:
    return ngettext("%(n)d of your bookings is affected", "%(n)d of your bookings are affected", count)


def _given_back(count: int) -> str:
    return ngettext("%(n)d booking is yours again", "%(n)d bookings are yours again", count)


def _write(lines: list[Line], actor: Actor, now: datetime, of_many: Callable[[int], str]) -> None:
    by_person: dict[User, list[Line]] = {}
    sharers = sharers_of([line.booking for line in lines if line.turn is None])
    for line in lines:
        for person in {line.turn.person} if line.turn else {line.booking.person, *sharers[line.booking.pk]}:
            if person.is_active:
                by_person.setdefault(person, []).append(line)
    by = actor.display_name if isinstance(actor, User) else actor.name
    for person, theirs in by_person.items():
        if isinstance(actor, User) and actor.pk == person.pk:
            continue
        zone = zone_of(person.time_zone)
        with override(of_person(person.language)), timezone.override(zone):
            subject = _subject(theirs, of_many)
            text = [*(_in_words(line, zone) for line in theirs), _("Changed by %(name)s.") % {"name": by}]
        about = [line.booking for line in theirs if line.turn is None]
        notification_write(to=person, subject=subject, text="\n".join(text), now=now, about=about, later=True)


def _subject(lines: list[Line], of_many: Callable[[int], str]) -> str:
    if len(lines) > 1:
        return of_many(len(lines)) % {"n": len(lines)}
    [line] = lines
    words = {"robot": line.booking.robot.name, "what": line.what()}
    return _("Your booking of %(robot)s: %(what)s") % words


def _in_words(line: Line, zone: ZoneInfo) -> str:
    return " ".join(filter(None, [f"{in_words(line.booking, zone)}: {line.what()}.", line.why()]))
