"""Make a change if somebody has seen what it takes from people; else undo it at once, and say what it would take.

The change itself is made in both cases, in one transaction: so the preview cannot differ from what happens.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from datetime import datetime, timedelta
from functools import partial
from hashlib import sha256
from typing import Generic, TypeVar
from uuid import UUID

from django.db import transaction
from django.utils import timezone
from msgspec import Struct, field, structs, to_builtins

from fleet.accounts.models import User
from fleet.audit.models import Record
from fleet.base.formats.sentences import words_of
from fleet.bookings.losses import letters
from fleet.bookings.losses.collecting import Actor, Collected, How, Loss, collected, collecting, kept_of, lost
from fleet.bookings.losses.lost_rights import bookings_free_lost, free_lessons, lessons_astray, store_ends
from fleet.bookings.losses.lost_turns import turns_watched
from fleet.bookings.losses.rows import Row, rows_before, rows_changed, subjects
from fleet.bookings.models import Booking, Change, Policy, State
from fleet.bookings.rules import FAR, Slot, Wish, closed
from fleet.bookings.selectors import held_between, wish_of
from robots.access.models import Course
from robots.registry.models import Robot
from robots.shared.wire import Refusal

Answer = TypeVar("Answer")

KEPT = timedelta(days=400)  # an archived course may be opened again


class Seen(Struct, frozen=True):
    """The losses that somebody has seen and confirmed: their digest; None: all of them, whatever they are."""

    digest: str | None
    closed_stay: bool = False  # bookings outside of new opening hours stay


class Weighed(Struct, Generic[Answer]):
    """A change that was made, or only tried."""

    answer: Answer
    done: bool
    losses: list[Loss] = field(default_factory=list)
    change: Change | None = None  # what was taken, and can be undone; not stored if the change was not made
    came_back: list[Booking] = field(default_factory=list)
    stay_lost: list[Booking] = field(default_factory=list)

    @property
    def digest(self) -> str:
        """Return a hash of the losses, which shows whether they are still those that were seen."""
        named = sorted(f"{one.booking.pk} {one.how} {one.person.pk}" for one in self.losses)
        return sha256("\n".join(named).encode()).hexdigest()[:24]


def weigh(
    make: Callable[[], Answer], *, actor: Actor, seen: Seen | None, only_try: bool = False
) -> Weighed[Answer]:
    """Make a change. If it takes time from people and this was not seen, or with `only_try`, it is not made.

    All robots are locked first: the change may end bookings of any of them, and others wait for it in one order only.
    """
    now = timezone.now()
    with transaction.atomic(), collecting(actor, now) as found:
        robots = list(Robot.objects.select_for_update(no_key=True, of=("self",)).order_by("pk"))
        before = rows_before()
        last = Record.objects.order_by("-pk").values_list("pk", flat=True).first() or 0
        astray = lessons_astray(now)
        # Another group of a robot may have other hours; policies and holidays look themselves.
        by_group = Policy.objects.filter(group__isnull=False).exists()
        with hours_watched(robots, now) if by_group else nullcontext(), turns_watched(now):
            weighed = Weighed(make(), True)
            if found.people != set():
                bookings_free_lost(found.people, now)
                free_lessons([one for key, one in lessons_astray(now).items() if key not in astray], now)
        weighed.losses = sorted(found.losses, key=lambda one: one.booking.starts_at)
        weighed.came_back, weighed.stay_lost = found.came_back, found.stay_lost
        if only_try or (weighed.losses and not _is_seen(weighed, seen)):
            if weighed.losses:
                weighed.change = _change(weighed.losses, found, rows_changed(before), last)
            transaction.set_rollback(True)
            weighed.done = False
        elif weighed.losses and seen:
            weighed.losses = _closed_ended(weighed.losses, now, stay=seen.closed_stay)
            if weighed.losses:
                weighed.change = _change(weighed.losses, found, rows_changed(before), last)
                weighed.change.save()
                letters.write_losses(weighed.losses, actor, now)
    return weighed


def _is_seen(weighed: Weighed[Answer], seen: Seen | None) -> bool:
    return seen is not None and seen.digest in (None, weighed.digest)


def _change(losses: list[Loss], found: Collected, rows: list[Row], last: int) -> Change:
    """Return, to be stored, what a change took, and the rows that it changed."""
    actor = found.actor if isinstance(found.actor, User) else None
    made = Record.objects.filter(pk__gt=last, actor=str(actor.pk) if actor else None).order_by("pk")
    kind = made.exclude(kind__startswith="booking.").values_list("kind", flat=True).first() or ""
    archived = next((row.key for row in rows if _archives(row)), None)
    return Change(
        actor=actor,
        made_at=found.now,
        kind=kind,
        about=", ".join(subjects(rows))[:200],
        rows=[] if found.for_good else to_builtins(rows),
        losses=[_stored(one) for one in losses],
        archived=Course.objects.filter(pk=archived).first() if archived else None,
    )


def _archives(row: Row) -> bool:
    return row.table == Course._meta.label and (row.after or {}).get("archived") is True


def _stored(loss: Loss) -> dict[str, object]:
    kept = {
        "booking": str(loss.booking.pk),
        "how": loss.how.value,
        "version": loss.booking.version,
        "before": to_builtins(loss.before),
    }
    return kept | ({"turn": loss.turn.pk} if loss.turn else {})


# --- opening hours --------------------------------------------------------------------------------


@contextmanager
def hours_watched(robots: list[Robot], now: datetime) -> Iterator[None]:
    """Collect the bookings of these robots that are outside of the opening hours after the change, and only then."""
    if (found := collected()) is None:
        yield
        return
    before = {one.pk for one, _why in _outside(robots, now)}
    yield
    before |= {one.booking.pk for one in found.losses}
    for booking, why in _outside(robots, now):
        if booking.pk not in before:
            lost(booking, How.CLOSED, now, before=kept_of(booking), why=partial(words_of, why))


def _outside(robots: list[Robot], now: datetime) -> Iterator[tuple[Booking, Refusal]]:
    """Return the bookings to come that the opening hours refuse now, without those against the policy."""
    held = held_between(robots, now, FAR).filter(state__in=(State.BOOKED, State.AWAITING), starts_at__gt=now)
    wishes: dict[UUID, Wish] = {}  # hours and holidays are the same for all bookings of a robot
    for booking in held.exclude(overridden=True).order_by("starts_at"):
        slot = Slot(booking.starts_at, booking.ends_at)
        if (wish := wishes.get(booking.robot_id)) is None:
            wish = wish_of(robot=booking.robot, person=booking.person, slot=slot, now=now, moved=booking)
            wishes[booking.robot_id] = wish
        if (why := closed(structs.replace(wish, slot=slot))) is not None:
            yield booking, why


def _closed_ended(losses: list[Loss], now: datetime, *, stay: bool) -> list[Loss]:
    """Cancel the bookings outside of the new opening hours; if they stay, leave them out."""
    if stay:
        return [one for one in losses if one.how is not How.CLOSED]
    shut = [one for one in losses if one.how is How.CLOSED]
    for loss, how in zip(shut, store_ends([(one.booking, "closed") for one in shut], now), strict=True):
        loss.how = how
    return losses


def remove_old_changes(now: datetime) -> None:
    """Remove changes that nobody can undo any more."""
    Change.objects.filter(made_at__lt=now - KEPT).delete()
