"""How many changes and sign-ins one person may make: each leaves rows and a record, so nobody may make any number.

They are counted in the log, so that several web processes count together. Changes that give something back
(cancel, leave, end, stop) are never refused: there are no more of them than of the changes before them.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timedelta

from django.contrib.auth.models import AbstractUser
from django.db.models import Min
from django.db.models.functions import Coalesce

from fleet.audit.errors import TooManyChanges
from fleet.audit.models import Record
from robots.shared.sentences import catalogued

DAY = timedelta(days=1)
HOUR = timedelta(hours=1)
Bounds = Sequence[tuple[timedelta, str, int]]  # a period, its name, and the most in it

MOST: Bounds = ((HOUR, catalogued("hour"), 400), (DAY, catalogued("day"), 2000))
MOST_SIGN_INS: Bounds = ((HOUR, "hour", 200), (DAY, "day", 1000))
COUNTED = (
    "account.change",
    "account.link",
    "account.second_factor",
    "audit.export",
    "booking.accept",
    "booking.approve",
    "booking.feed",
    "booking.guest",
    "booking.hand",
    "booking.hand_ask",
    "booking.join",
    "booking.make",
    "booking.move",
    "booking.tasks",
    "booking.undo",
    "booking.wait",
    "control.ask",
    "control.hand_over",
    "control.renew",
    "control.take",
    "control.take_over",
    "course.archive",
    "course.change",
    "course.enrol",
    "course.invite",
    "course.marks",
    "course.number",
    "course.reopen",
    "layout.share",
    "map.name",
    "place.change",
    "place.create",
    "place.import",
    "policy.change",
    "push.add",
    "qualification.grant",
    "recording.begin",
    "recording.download",
    "recording.keep",
    "recording.mark",
    "recording.share",
    "robot.out_of_service",
    "stop.clear",
    "token.make",
    "turn.call",
    "turn.extend",
    "turn.fill",
    "turn.hold",
    "turn.join",
    "turn.spread",
)
# Kinds that programs, reloads and lists make more often, so each group has bounds of its own.
# The bound of calls is low: a check reads all calls of the day, and the robot is locked meanwhile.
OFTEN: tuple[tuple[tuple[str, ...], str, Bounds], ...] = (
    (
        ("control.resume",),
        catalogued("come back to control {most} times"),
        ((HOUR, "hour", 600), (DAY, "day", 3000)),
    ),
    (
        ("parameter.delete", "parameter.set", "service.call"),
        catalogued("called services or set parameters {most} times"),
        ((HOUR, "hour", 3600), (DAY, "day", 5000)),
    ),
    (("account.create",), catalogued("made {most} accounts"), ((DAY, "day", 10_000),)),
)


def require_rate(kind: str, actor: object, now: datetime, count: int = 1) -> None:
    """Raise `TooManyChanges` if a person without staff rights may not make `count` more changes of this kind."""
    if isinstance(actor, AbstractUser):
        for kinds, did, bounds in ((COUNTED, catalogued("made {most} changes"), MOST), *OFTEN):
            if kind in kinds:
                _require(actor, kinds, did, bounds, now, count)


def require_sign_in_rate(person: AbstractUser, now: datetime) -> None:
    """Raise `TooManyChanges` if a person without staff rights has signed in too often.

    To be called before the sign-in: its record is written afterwards. Other changes lock nobody out.
    """
    _require(person, ("account.sign_in",), catalogued("signed in {most} times"), MOST_SIGN_INS, now)


def _require(
    person: AbstractUser,
    kinds: Sequence[str],
    did: str,
    bounds: Bounds,
    now: datetime,
    count: int = 1,
) -> None:
    if person.is_staff:
        return
    # The order number comes first in the indexes by actor, so old records need not be read.
    since = Record.objects.filter(day__gte=(now - DAY).date()).aggregate(first=Min("id"))["first"]
    if since is None:
        return
    made = Record.objects.filter(actor=str(person.pk), kind__in=kinds, id__gte=since)
    # Outcomes do not count. Without Coalesce, SQLite would use their index and read half of the log.
    made = made.alias(request=Coalesce("of_id", 0)).filter(request=0)
    for period, name, most in bounds:
        latest = made.filter(at__gt=now - period).order_by("-id").values_list("at", flat=True)
        if (first := latest[max(most - count, 0) :].first()) is not None:
            raise TooManyChanges(did, name, most, (first + period - now).total_seconds())
