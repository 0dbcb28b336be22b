"""The page of a lesson: all its robots with their lines of turns, for its people and for who leads it."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from functools import partial
from typing import Any
from uuid import UUID

from django.core.exceptions import PermissionDenied
from django.http import Http404, HttpRequest, HttpResponse, QueryDict
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import ngettext
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods
from msgspec import Struct, ValidationError, convert

from fleet.accounts.models import User
from fleet.accounts.requests import person_of
from fleet.base.zones import viewers
from fleet.bookings.lessons import turns
from fleet.bookings.lessons.members import sharers_of, shares
from fleet.bookings.lessons.robots import why_nobody_is_called
from fleet.bookings.lessons.standings import Standing, standings
from fleet.bookings.lessons.tasks import lesson_tasks_set, tasks_of
from fleet.bookings.lessons.together import at_once, line_spread
from fleet.bookings.models import Booking, Shared
from fleet.bookings.rules import Slot, from_to
from fleet.bookings.schedule import call_left_s
from fleet.bookings.services import BookingRefused
from robots.access.selectors import lacking, robots_bookable_by, robots_visible_to
from robots.places.selectors import newest_maps, places_of
from robots.registry.models import Robot
from robots.registry.selectors import phrases_of
from robots.shared.wire import LessonTasks, Refusal

EXTENDED_MIN = 2  # by one press
SHARES = (20, 40, 60, 80, 100)  # percent of a robot's speed limits to choose from


class Lane(Struct, frozen=True):
    """One robot of a lesson: who is called or drives, and who waits."""

    booking: Booking
    leads: bool
    opens: bool  # this person may see the robot
    open: bool  # the line can change
    now: Standing | None
    left_s: int | None  # until the end of the turn, or of the call
    waiting: list[Standing]
    mine: Standing | None
    why: str  # nobody is called now; empty: they are
    lacks: str  # for who leads it: how many may not drive the robot, for want of a qualification

    @property
    def clock(self) -> str:
        """Return the time that is left, such as 4:05; scripts count it down."""
        minutes, seconds = divmod(self.left_s or 0, 60)
        return f"{minutes}:{seconds:02}"

    @property
    def before_me(self) -> int:
        """Return how many people wait before this person."""
        return (self.mine.place or 1) - 1 if self.mine else 0


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def lesson(request: HttpRequest, booking_id: UUID) -> HttpResponse:
    """Show the lines of a lesson, and change them."""
    person = person_of(request)
    booking = get_object_or_404(Booking.objects.select_related("robot", "person", "course"), pk=booking_id)
    if not robots_bookable_by(person).filter(pk=booking.robot_id).exists():
        raise Http404
    if not turns.leads(person, booking) and not shares(booking, person):
        raise PermissionDenied(turns.NOT_IN_IT.text)
    if request.method != "POST":
        return _page(request, booking)
    try:
        _step(request.POST, booking, person)()
    except BookingRefused as error:
        booking.refresh_from_db()
        return _page(request, booking, error.refusals)
    return redirect("lesson", booking_id=booking_id)


def _step(typed: QueryDict, booking: Booking, person: User) -> Callable[[], Any]:
    """Return the change that the person asked for."""
    common: dict[str, Any] = {"booking_id": booking.pk, "now": timezone.now()}
    leads: dict[str, Any] = {**common, "actor": person}
    number = typed.get("turn", "")
    turn_id = int(number) if number.isascii() and number.isdigit() and len(number) < 16 else 0
    username = typed.get("person", "").replace("\0", "").strip()
    steps: dict[str, Callable[[], Any]] = {
        "join": partial(turns.turn_join, **common, person=person),
        "leave": partial(turns.turn_leave, **common, person=person),
        "fill": partial(turns.line_fill, **leads),
        "spread": partial(line_spread, **leads),
        "call": partial(turns.turn_call, **leads, username=username),
        "skip": partial(turns.turn_skip, **leads, turn_id=turn_id),
        "extend": partial(turns.turn_extend, **leads, turn_id=turn_id, minutes=EXTENDED_MIN),
        "hold": partial(turns.line_hold, **leads, hold=True),
        "go_on": partial(turns.line_hold, **leads, hold=False),
        "tasks": partial(_choose_tasks, typed, leads),
    }
    if (step := steps.get(typed.get("action", ""))) is None:
        raise Http404
    return step


def _choose_tasks(typed: QueryDict, leads: dict[str, Any]) -> None:
    share = typed.get("share", "")
    try:
        tasks = convert(
            {
                "max_share": int(share) / 100 if share.isascii() and share.isdigit() else 1.0,
                "watch": bool(typed.get("watch")),
                **{name: typed.getlist(name) for name in ("motions", "phrases", "places", "without")},
            },
            LessonTasks,
        )
    except (ValidationError, ValueError) as error:
        raise Http404 from error  # no form of ours
    lesson_tasks_set(**leads, tasks=tasks, whole_series=bool(typed.get("whole_series")))


def _page(request: HttpRequest, booking: Booking, refusals: list[Refusal] | None = None) -> HttpResponse:
    person, now = person_of(request), timezone.now()
    leads = turns.leads(person, booking)
    lanes = [_lane(one, person, now) for one in at_once(booking)]
    mine = next((one for one in lanes if one.mine), None)
    context = {
        "booking": booking,
        "title": booking.lesson_of or booking.person.display_name,
        "times": from_to(Slot(booking.starts_at, booking.ends_at), viewers()),
        "zone": viewers().key,
        "lanes": sorted(lanes, key=lambda one: one is not mine),
        "drivable": sum(not one.why for one in lanes) or len(lanes),
        "mine": mine,
        "leads": leads,
        "open": booking.turn_min is not None and booking.held_until > now,
        "refusals": refusals or [],
        "extended_min": EXTENDED_MIN,
        "tasks": tasks_of(booking) if booking.tasks else None,
        "percent": round(100 * tasks_of(booking).max_share),
    }
    if leads and booking.shared == Shared.COURSE and booking.held_until > now:
        context["choices"] = _choices(booking.robot, tasks_of(booking))
    return render(request, "bookings/lesson.html", context, status=409 if refusals else 200)


def _lane(booking: Booking, person: User, now: datetime) -> Lane:
    line = standings(booking, now) if booking.turn_min else []
    first = line[0] if line and line[0].place is None else None
    left_s = None
    if first is not None and first.ends_at is not None:
        left_s = max(0, round((first.ends_at - now).total_seconds()))
    elif first is not None and first.called_at is not None:
        left_s = round(call_left_s(first.called_at, now))
    leads, over = turns.leads(person, booking), booking.held_until <= now
    return Lane(
        booking=booking,
        leads=leads,
        opens=robots_visible_to(person).filter(pk=booking.robot_id).exists(),
        open=booking.turn_min is not None and not over,
        now=first,
        left_s=left_s,
        waiting=[one for one in line if one.place is not None],
        mine=next((one for one in line if one.person == person), None),
        why="" if over else why_nobody_is_called(booking, now),
        lacks=_lacks(booking, now) if leads and not over else "",
    )


def _lacks(booking: Booking, now: datetime) -> str:
    """Return how many people of a lesson lack a qualification that its robot demands, in words; empty: nobody."""
    found = lacking(booking.robot, sharers_of([booking])[booking.pk], max(now, booking.starts_at))
    text = ngettext(
        "%(n)d person may not drive this robot, and is not called. Missing: %(names)s.",
        "%(n)d people may not drive this robot, and are not called. Missing: %(names)s.",
        len(found),
    )
    names = sorted({one.name for missing in found.values() for one in missing})
    return text % {"n": len(found), "names": ", ".join(names)} if found else ""


def _choices(robot: Robot, tasks: LessonTasks) -> dict[str, Any]:
    """Return what can be chosen for a lesson on this robot, with what is chosen. Scripts add the robot's motions."""
    newest = newest_maps([robot.pk]).get(robot.pk)
    places = [one.name for one in places_of([newest.digest]).get(newest.digest, [])] if newest else []
    phrases = [line.text for _key, line in phrases_of(robot)]
    percent = round(100 * tasks.max_share)
    return {
        "shares": [(one, one == percent) for one in sorted({*SHARES, percent})],
        "watch": tasks.watch,
        "without": tasks.without,
        "motions": [(one, True) for one in tasks.motions],
        "phrases": _marked(phrases, tasks.phrases),
        "places": _marked(places, tasks.places),
    }


def _marked(offered: list[str], chosen: list[str]) -> list[tuple[str, bool]]:
    """Return what is offered or chosen, and whether it is chosen."""
    return [(one, one in chosen) for one in dict.fromkeys([*offered, *chosen])]
