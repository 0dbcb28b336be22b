"""How many changes one person may make: each leaves rows and a record, so nobody may make any number of them.

They are counted in the log, so that several web processes count together. Changes that give something back
(cancel, leave, end, stop) are never refused: there are no more of them than of the changes before them.
"""

from __future__ import annotations

from datetime import datetime, timedelta

from django.contrib.auth.models import AbstractUser
from django.db.models import Min

from fleet.audit.errors import TooManyChanges
from fleet.audit.models import Record

DAY = timedelta(days=1)
MOST = ((timedelta(hours=1), "hour", 400), (DAY, "day", 2000))
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
    if kind not in COUNTED or not isinstance(actor, AbstractUser) or actor.is_staff:
        return
    # The order number comes first in the indexes by actor, so old records need not be read.
    since = Record.objects.filter(day__gte=(now - DAY).date()).aggregate(first=Min("id"))["first"]
    if since is None:
        return
    made = Record.objects.filter(actor=str(actor.pk), kind__in=COUNTED, id__gte=since)
    for period, name, most in MOST:
        oldest = (
            made.filter(at__gt=now - period).order_by("-id").values_list("at", flat=True)[most - 1 : most]
        )
        if (first := oldest.first()) is not None:
            raise TooManyChanges(name, most, (first + period - now).total_seconds())
