"""How many changes and sign-ins one person may make: each leaves rows and a record, so nobody may make any number.

They are counted in the log, so that several web processes count together. Changes that give something back
(cancel, leave, end, stop) are never refused: there are no more of them than of the changes before them.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timedelta

from django.contrib.auth.models import AbstractUser
from django.db.models import Min

from fleet.audit.errors import TooManyChanges
from fleet.audit.models import Record

DAY = timedelta(days=1)
HOUR = timedelta(hours=1)
MOST = ((HOUR, "hour", 400), (DAY, "day", 2000))
MOST_SIGN_INS = ((HOUR, "hour", 200), (DAY, "day", 1000))
COUNTED = (
    "account.change",
    "account.second_factor",
    "booking.accept",
    "booking.approve",
    "booking.feed",
    "booking.hand",
    "booking.make",
    "booking.move",
    "booking.wait",
    "control.ask",
    "control.hand_over",
    "control.renew",
    "control.take",
    "control.take_over",
    "course.invite",
    "map.name",
    "place.change",
    "place.create",
    "place.import",
    "stop.clear",
    "token.make",
)


def require_rate(kind: str, actor: object, now: datetime) -> None:
    """Raise `TooManyChanges` if a person without staff rights has made too many changes of these kinds."""
    if kind in COUNTED and isinstance(actor, AbstractUser):
        _require(actor, COUNTED, "made %s changes", MOST, now)


def require_sign_in_rate(person: AbstractUser, now: datetime) -> None:
    """Raise `TooManyChanges` if a person without staff rights has signed in too often.

    To be called before the sign-in: its record is written afterwards. Other changes lock nobody out.
    """
    _require(person, ("account.sign_in",), "signed in %s times", MOST_SIGN_INS, now)


def _require(
    person: AbstractUser,
    kinds: Sequence[str],
    did: str,
    bounds: Sequence[tuple[timedelta, str, int]],
    now: datetime,
) -> None:
    if person.is_staff:
        return
    # The order number comes first in the indexes by actor, so old records need not be read.
    since = Record.objects.filter(day__gte=(now - DAY).date()).aggregate(first=Min("id"))["first"]
    if since is None:
        return
    made = Record.objects.filter(actor=str(person.pk), kind__in=kinds, id__gte=since)
    for period, name, most in bounds:
        oldest = (
            made.filter(at__gt=now - period).order_by("-id").values_list("at", flat=True)[most - 1 : most]
        )
        if (first := oldest.first()) is not None:
            raise TooManyChanges(did % most, name, most, (first + period - now).total_seconds())
