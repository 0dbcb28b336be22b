"""A weekly series as one: its bookings, what is against them now, and changes of all from a day on."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from datetime import date, datetime, time, timedelta
from uuid import UUID

from django.db import transaction
from django.db.models import Q, QuerySet
from msgspec import Struct

from fleet.accounts.models import User
from fleet.base.zones import viewers, zone_of
from fleet.bookings.changes.series import on_the_wall
from fleet.bookings.models import Booking, Holiday, Policy, State
from fleet.bookings.permissions import bookings_managed_by
from fleet.bookings.rules import Slot, Wish, closed, in_service
from fleet.bookings.selectors import Stage, grace_of, out_between, policies_of, stage_of
from fleet.bookings.services import BookingRefused, booking_cancel, booking_move, robots_locked
from robots.access.selectors import robots_bookable_by
from robots.registry.models import Robot
from robots.shared.wire import Refusal


class Date(Struct, frozen=True):
    """One booking of a series, and what is against it: now, or against `slot`, the new one."""

    booking: Booking
    stage: Stage
    refusals: list[Refusal]
    slot: Slot | None = None

    @property
    def to_come(self) -> bool:
        """Return whether the booking may still be changed as part of its series."""
        return self.stage in (Stage.AWAITING, Stage.BOOKED)


class Change(Struct, frozen=True):
    """A change of a series. None: as it is. Weekday and time are those of the lab's zone, within the same week."""

    weekday: int | None = None  # 0: Monday
    begins: time | None = None
    minutes: int | None = None  # its length on the wall clock
    robot: Robot | None = None


def series_of(person: User, series: UUID | None = None) -> QuerySet[Booking]:
    """Return the bookings of a series, or of all, that the person may change: one's own, and those one manages."""
    robots = robots_bookable_by(person).values("pk").order_by()
    every = (
        Booking.objects.filter(series__isnull=False)
        if series is None
        else Booking.objects.filter(series=series)
    )
    managed = bookings_managed_by(person, every).values("pk").order_by()
    mine = every.filter(Q(person=person) | Q(pk__in=managed))
    return mine.filter(robot__in=robots).select_related("robot", "person", "course").order_by("starts_at")


def series_to_come(person: User, now: datetime) -> list[Booking]:
    """Return the next booking of each series that the person may change."""
    coming = series_of(person).filter(state__in=(State.BOOKED, State.AWAITING), starts_at__gt=now)
    return list({one.series: one for one in reversed(coming)}.values())[::-1]


def dates_of(bookings: Iterable[Booking], now: datetime) -> list[Date]:
    """Return the dates of a series, each to come with what is against it now: closed, or out of service."""
    found = list(bookings)
    policies = policies_of({one.robot for one in found})
    dates = [Date(one, stage_of(one, grace_of(policies[one.robot_id]), now), []) for one in found]
    holidays = tuple(Holiday.objects.filter(last_day__gte=now.date() - timedelta(days=1)))
    for one in dates:
        if one.to_come:
            one.refusals.extend(_against(one.booking, policies[one.booking.robot_id], holidays, now))
    return dates


def _against(booking: Booking, policy: Policy, holidays: tuple[Holiday, ...], now: datetime) -> list[Refusal]:
    slot = Slot(booking.starts_at, booking.ends_at)
    wish = Wish(
        booking.robot.name,
        slot=slot,
        now=now,
        policy=policy,
        lab=zone_of(""),
        zone=viewers(),
        out=tuple(out_between(booking.robot, slot.starts_at, slot.ends_at)),
        holidays=holidays,
    )
    return [refusal for rule in (in_service, closed) if (refusal := rule(wish)) is not None]


def series_move(
    bookings: Iterable[Booking],
    change: Change,
    *,
    since: date,
    actor: User,
    now: datetime,
    override: str = "",
    preview: bool = False,
) -> list[Date]:
    """Move the bookings from a day on that no rule refuses there. Return them all, with the refusals of the others.

    `preview`: move none.
    """

    def step(booking: Booking, slot: Slot) -> None:
        robot = change.robot or booking.robot
        if (slot.starts_at, slot.ends_at, robot) == (booking.starts_at, booking.ends_at, booking.robot):
            return
        booking_move(
            booking_id=booking.pk,
            version=booking.version,
            slot=slot,
            robot=robot,
            actor=actor,
            override=override,
            now=now,
        )

    return _each(bookings, since, now, step, change, preview)


def series_cancel(
    bookings: Iterable[Booking],
    *,
    since: date,
    actor: User,
    now: datetime,
    reason: str = "",
    preview: bool = False,
) -> list[Date]:
    """Cancel the bookings from a day on. Return them all, with the refusals of those that stay."""

    def step(booking: Booking, _slot: Slot) -> None:
        version = booking.version
        booking_cancel(booking_id=booking.pk, version=version, actor=actor, now=now, reason=reason)

    return _each(bookings, since, now, step, Change(), preview)


def moved(booking: Booking, change: Change) -> Slot | Refusal:
    """Return the new slot of a booking; a refusal if the clock skips its begin or end that day."""
    lab = zone_of("")
    starts, ends = (at.astimezone(lab).replace(tzinfo=None) for at in (booking.starts_at, booking.ends_at))
    if (change.weekday, change.begins, change.minutes) == (None, None, None):
        return Slot(booking.starts_at, booking.ends_at)
    length = ends - starts if change.minutes is None else timedelta(minutes=change.minutes)
    days = 0 if change.weekday is None else change.weekday - starts.weekday()
    begins = datetime.combine(starts.date() + timedelta(days=days), change.begins or starts.time())
    return on_the_wall(begins, begins + length, lab)


def _each(
    bookings: Iterable[Booking],
    since: date,
    now: datetime,
    step: Callable[[Booking, Slot], None],
    change: Change,
    preview: bool,
) -> list[Date]:
    """Change the bookings to come from a day on, in one transaction. Those that a rule refuses stay as they are."""
    chosen = [
        one
        for one in dates_of(bookings, now)
        if one.to_come
        and one.booking.starts_at > now
        and one.booking.starts_at.astimezone(zone_of("")).date() >= since
    ]
    robots = {one.booking.robot_id for one in chosen} | ({change.robot.pk} if change.robot else set())
    with transaction.atomic():
        with robots_locked(robots, now):
            found = [_changed(one, moved(one.booking, change), step) for one in chosen]
        if preview:
            transaction.set_rollback(True)
    return found


def _changed(one: Date, slot: Slot | Refusal, step: Callable[[Booking, Slot], None]) -> Date:
    if isinstance(slot, Refusal):
        return Date(one.booking, one.stage, [slot])
    try:
        step(one.booking, slot)
    except BookingRefused as error:
        return Date(one.booking, one.stage, error.refusals, slot)
    return Date(one.booking, one.stage, [], slot)
