"""The page of a shared booking with turns: its line, for the people who share it and who lead it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any
from uuid import UUID

from django.core.exceptions import PermissionDenied
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods

from fleet.accounts.models import User
from fleet.accounts.requests import person_of
from fleet.base.zones import viewers
from fleet.bookings.lessons import turns
from fleet.bookings.lessons.members import shares
from fleet.bookings.lessons.standings import standings
from fleet.bookings.models import Booking
from fleet.bookings.rules import Slot, from_to
from fleet.bookings.schedule import CALL_S
from fleet.bookings.services import BookingRefused
from robots.access.selectors import robots_bookable_by, robots_visible_to
from robots.shared.wire import Refusal

EXTENDED_MIN = 5  # by one press


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def lesson(request: HttpRequest, booking_id: UUID) -> HttpResponse:
    """Show the line of a shared booking, and change it."""
    person = person_of(request)
    booking = get_object_or_404(Booking.objects.select_related("robot", "person", "course"), pk=booking_id)
    if not robots_bookable_by(person).filter(pk=booking.robot_id).exists():
        raise Http404
    if not turns.leads(person, booking) and not shares(booking, person):
        raise PermissionDenied(turns.NOT_IN_IT.text)
    if request.method != "POST":
        return _page(request, booking)
    try:
        _step(request, booking, person)()
    except BookingRefused as error:
        booking.refresh_from_db()
        return _page(request, booking, error.refusals)
    return redirect("lesson", booking_id=booking_id)


def _step(request: HttpRequest, booking: Booking, person: User) -> Callable[[], Any]:
    """Return the change that the person asked for."""
    common: dict[str, Any] = {"booking_id": booking.pk, "now": timezone.now()}
    leads: dict[str, Any] = {**common, "actor": person}
    number = request.POST.get("turn", "")
    turn_id = int(number) if number.isascii() and number.isdigit() and len(number) < 16 else 0
    username = request.POST.get("person", "").replace("\0", "").strip()
    steps: dict[str, Callable[[], Any]] = {
        "join": partial(turns.turn_join, **common, person=person),
        "leave": partial(turns.turn_leave, **common, person=person),
        "fill": partial(turns.line_fill, **leads),
        "call": partial(turns.turn_call, **leads, username=username),
        "skip": partial(turns.turn_skip, **leads, turn_id=turn_id),
        "extend": partial(turns.turn_extend, **leads, turn_id=turn_id, minutes=EXTENDED_MIN),
        "hold": partial(turns.line_hold, **leads, hold=True),
        "go_on": partial(turns.line_hold, **leads, hold=False),
    }
    if (step := steps.get(request.POST.get("action", ""))) is None:
        raise Http404
    return step


def _page(request: HttpRequest, booking: Booking, refusals: list[Refusal] | None = None) -> HttpResponse:
    person, now = person_of(request), timezone.now()
    line = standings(booking, now) if booking.turn_min else []
    context = {
        "booking": booking,
        "title": booking.lesson_of or booking.person.display_name,
        "times": from_to(Slot(booking.starts_at, booking.ends_at), viewers()),
        "zone": viewers().key,
        "line": line,
        "mine": next((one for one in line if one.person == person), None),
        "leads": turns.leads(person, booking),
        "open": booking.turn_min is not None and booking.held_until > now,
        "opens": robots_visible_to(person).filter(pk=booking.robot_id).exists(),
        "refusals": refusals or [],
        "call_s": CALL_S,
        "extended_min": EXTENDED_MIN,
    }
    return render(request, "bookings/lesson.html", context, status=409 if refusals else 200)
