"""The pages of bookings: calendar, form, one's own list, one booking."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from datetime import datetime, timedelta
from typing import Any
from uuid import UUID

from django.contrib import messages
from django.contrib.auth.decorators import login_not_required
from django.db.models import Q, QuerySet
from django.http import Http404, HttpRequest, HttpResponse, JsonResponse, QueryDict
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import timezone
from django.utils.http import url_has_allowed_host_and_scheme, urlencode
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from fleet.accounts.models import User
from fleet.accounts.requests import person_of, wants_json
from fleet.base.web.origin import public_url
from fleet.base.zones import viewers
from fleet.bookings import services
from fleet.bookings.changes import handing
from fleet.bookings.changes.waiting_list import offer_accept, waiting_join, waiting_leave
from fleet.bookings.free_time import free_on_any
from fleet.bookings.hours.quota_left import common_left, left_of
from fleet.bookings.lessons.members import shares, teams_of
from fleet.bookings.lessons.turns import leads
from fleet.bookings.messages.ical import address_make, address_revoke, feed_of
from fleet.bookings.models import Booking, FeedAddress, Holiday, State, Waiting
from fleet.bookings.pages.calendar import calendar
from fleet.bookings.pages.forms import SlotForm, typed_day, typed_time
from fleet.bookings.permissions import awaiting_approval, may_manage_booking, shows_person
from fleet.bookings.rules import Slot, from_to
from fleet.bookings.selectors import (
    OPEN,
    RobotFacts,
    Stage,
    bookings_of,
    grace_of,
    held_between,
    is_recorded,
    policies_of,
    stage_of,
)
from fleet.bookings.services import BookingRefused
from fleet.bookings.shared_facts import in_turn
from robots.access.models import Course
from robots.access.selectors import (
    bookable_by,
    courses_managed_by,
    lab_date,
    manages_robot,
    robots_bookable_by,
    robots_managed_by,
    robots_visible_to,
    supervises,
    visible_to,
)
from robots.access.who_sees import reader_of
from robots.registry.models import Robot, Role
from robots.shared import wire
from robots.shared.sentences import say
from robots.shared.wire import Refusal

LISTED = 50  # rows at most in a list of one's own bookings
MOST = 500  # rows at most in a list of a course's bookings
_ONLY_ONESELF = Refusal(
    "not_for_others",
    "People join a waiting list for themselves: leave the other person’s user name out.",
    "booking",
)


@never_cache
@require_safe
def bookings(request: HttpRequest) -> HttpResponse:
    """Show the calendar of all robots that this person may see, and the day's bookings as a list."""
    robots = list(robots_bookable_by(person_of(request)))
    awaiting = awaiting_approval(person_of(request), timezone.now())[:LISTED]
    options = {**_form_options(person_of(request)), "courses": _courses_to_choose(person_of(request))}
    now, zone = timezone.now(), viewers()
    day = typed_day(request.GET.get("day")) or now.astimezone(zone).date()
    start = datetime.combine(day, datetime.min.time(), tzinfo=zone)
    held = held_between(robots, start, start + timedelta(days=1)).order_by("robot__name", "starts_at")
    context = {
        "robots": robots,
        "day": day,
        "previous": day - timedelta(days=1),
        "next": day + timedelta(days=1),
        "rows": _rows(held, robots, person_of(request), now),
        "holidays": Holiday.objects.filter(first_day__lte=day, last_day__gte=day),
        "zone": zone.key,
        "only": request.GET.get("robot", ""),
        "manages": robots_managed_by(person_of(request)).exists(),
        "kinds": _kinds(robots),
        "form": SlotForm(**options),
        "awaiting": _rows(awaiting, {one.robot for one in awaiting}, person_of(request), now),
    }
    return render(request, "bookings/calendar.html", context)


def _kinds(robots: list[Robot]) -> list[str]:
    """Return the kinds of robots to choose from, whatever their ROS. Return nothing if there is only one kind."""
    kinds = sorted({robot.profile.kind for robot in robots if robot.enabled})
    return kinds if len(kinds) > 1 else []


@never_cache
@require_safe
def feed(request: HttpRequest) -> HttpResponse:
    """Return robots and events between the days `start` and `end`, for the calendar's script."""
    first, last = typed_day(request.GET.get("start")), typed_day(request.GET.get("end"))
    if first is None or last is None or last <= first:
        return JsonResponse({"text": "Name two days: start=2026-03-02&end=2026-03-09."}, status=400)
    robots = robots_bookable_by(person_of(request)).select_related(None)
    if only := _text(request.GET, "robot"):
        robots = robots.filter(slug=only)
    found = calendar(person_of(request), robots, first, last, timezone.now())
    return HttpResponse(wire.encode(found), content_type="application/json")


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def booking_new(request: HttpRequest) -> HttpResponse:
    """Show the booking form, or book. A script gets all refusals and alternatives as JSON."""
    person = person_of(request)
    if request.method != "POST":
        options = {**_form_options(person), "courses": _courses_to_choose(person)}
        return _form_page(request, SlotForm(initial=_initial(request), **options))
    with in_turn() as facts:
        return _book(request, person, facts)


def _book(request: HttpRequest, person: User, facts: Callable[[Robot, Slot], RobotFacts]) -> HttpResponse:
    form = _typed(request, person)
    if not form.is_valid():
        return _refused(request, form, _form_refusals(form), form.choices if wants_json(request) else None)
    robot, named = form.cleaned_data["robot"], form.cleaned_data.get("person", "")
    try:
        booking = handing.booking_make_asking(
            robot=robot,
            person=services.account_named(named, person, robot, form.slot.starts_at) if named else person,
            actor=person,
            slot=form.slot,
            purpose=form.cleaned_data["purpose"],
            course=form.cleaned_data.get("course"),
            lesson_of=form.cleaned_data.get("lesson_of"),
            team=services.team_named(form.usernames, robot, form.slot.starts_at),
            turn_min=form.cleaned_data["turn_min"],
            record_it=form.cleaned_data["record"],
            override=form.cleaned_data.get("override", ""),
            now=timezone.now(),
            facts=facts,
        )
    except BookingRefused as error:
        return _refused(request, form, error.refusals, services.alternatives_of(error))
    if wants_json(request):
        return JsonResponse({"id": str(booking.pk), "version": booking.version})
    text = _("Booked: %(booking)s.")
    if booking.state == State.AWAITING:
        text = _("%(booking)s awaits approval. Until then it holds the slot, but you cannot take control.")
    messages.success(request, text % {"booking": _in_words(booking)})
    if asked := handing.asked_to_share(booking, timezone.now()):
        messages.info(request, _("Asked whether they share it: %(people)s.") % {"people": ", ".join(asked)})
    return redirect("bookings-mine")


@require_safe
def next_free(request: HttpRequest) -> HttpResponse:
    """Redirect to the form, filled in with the next free slot on any robot."""
    person = person_of(request)
    minutes = _whole(request.GET.get("minutes"), 60)
    robots = [robot for robot in robots_bookable_by(person) if robot.enabled]
    if kind := request.GET.get("kind"):
        robots = [robot for robot in robots if kind in (robot.profile.kind, robot.profile.slug)]
    now = timezone.now()
    found = free_on_any(robots, person, minutes, after=now, now=now, most=1)
    if not found:
        messages.warning(
            request, _("No robot that you may drive is free for so long until the end of next week.")
        )
        return redirect("bookings")
    return redirect(_filled_in(reverse("booking-new"), *found[0]))


@never_cache
@require_safe
def bookings_mine(request: HttpRequest) -> HttpResponse:
    """List one's own bookings: first the future ones, then the past ones."""
    now = timezone.now()
    found = list(bookings_of(person_of(request))[:LISTED])
    rows = _rows(found, {one.robot for one in found}, person_of(request), now)
    opens, _role = visible_to(person_of(request))  # not all booked robots: a course may begin later
    to_come = [row for row in rows if row["stage"] in OPEN]
    past = [row for row in rows if row["stage"] not in OPEN]
    context = {
        "to_come": to_come[::-1],
        "past": past,
        "opens": {row["booking"].robot_id for row in to_come} if opens is None else opens,
        "waiting": Waiting.objects.filter(person=person_of(request), starts_at__gt=now).select_related(
            "robot"
        ),
        "zone": viewers().key,
        "has_address": FeedAddress.objects.filter(person=person_of(request), robot=None).exists(),
        "robots": robots_bookable_by(person_of(request)),
        "left": left_of(person_of(request), now),
        "offers": [(one, _in_words(one.booking)) for one in handing.offers_to(person_of(request), now)],
    }
    return render(request, "bookings/mine.html", context)


@never_cache
@require_safe
def bookings_of_course(request: HttpRequest, slug: str) -> HttpResponse:
    """List a course's bookings, for its supervisors and staff: first the future ones, then the past ones."""
    course = get_object_or_404(courses_managed_by(person_of(request)), slug=slug)
    now = timezone.now()
    found = list(
        Booking.objects.filter(course=course)
        .select_related("robot", "course", "person")
        .order_by("-starts_at")[:MOST]
    )
    rows = _rows(found, {one.robot for one in found}, person_of(request), now)
    context = {
        "course": course,
        "to_come": [row for row in rows if row["stage"] in OPEN][::-1],
        "past": [row for row in rows if row["stage"] not in OPEN],
        "zone": viewers().key,
        "left": common_left(course, now),
    }
    return render(request, "bookings/course.html", context)


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def booking(request: HttpRequest, booking_id: UUID) -> HttpResponse:
    """Show one booking, and change it: move, cancel or finish, hand to a colleague, approve, accept."""
    person = person_of(request)
    robots = robots_bookable_by(person)
    found = get_object_or_404(Booking.objects.select_related("robot", "person", "course"), pk=booking_id)
    if not robots.filter(pk=found.robot_id).exists():
        raise Http404
    if request.method != "POST":
        return _booking_page(request, found)
    try:
        _change(request, found, person)
    except BookingRefused as error:
        if wants_json(request):
            return JsonResponse(_refusals_json(error.refusals, services.alternatives_of(error)), status=409)
        found.refresh_from_db()
        return _booking_page(request, found, error)
    if wants_json(request):
        return JsonResponse({"id": str(found.pk)})
    messages.success(request, _done(request, found))
    back = request.POST.get("back", "")
    if url_has_allowed_host_and_scheme(back, None):
        return redirect(back)
    return redirect("booking", booking_id=booking_id)


def _done(request: HttpRequest, found: Booking) -> str:
    """Return the message about what was done."""
    begun = found.starts_at <= timezone.now()
    found.refresh_from_db()
    words = {
        "approve": _("Approved: %(booking)s."),
        "accept": _("Accepted: %(booking)s."),
        "cancel": _("Finished: %(booking)s.") if begun else _("Cancelled: %(booking)s."),
        "hand": _("%(person)s is asked. The booking stays yours until they accept."),
    }
    text = words.get(request.POST.get("action", ""), _("Changed: %(booking)s."))
    asked = handing.offer_of(found, timezone.now())
    person = asked.to.display_name if asked and asked.to else ""
    return text % {"booking": _in_words(found), "person": person}


def _change(request: HttpRequest, found: Booking, person: User) -> None:
    common: dict[str, Any] = {"booking_id": found.pk, "actor": person, "now": timezone.now()}
    version = _whole(request.POST.get("version"), 0)
    action = request.POST.get("action")
    if action == "approve":
        services.booking_approve(version=version, **common)
    elif action == "accept":
        offer_accept(**common)
    elif action == "cancel":
        services.booking_cancel(version=version, reason=_text(request.POST, "reason")[:200], **common)
    elif action == "hand":
        to = services.colleague_named(_text(request.POST, "to"), person, found)
        handing.hand_ask(version=version, to=to, **common)
    else:
        form = SlotForm(
            {**request.POST.dict(), "robot": found.robot.slug},
            kept=(found.starts_at, found.ends_at),
            **_form_options(person, found.robot),
        )
        if not form.is_valid():
            raise BookingRefused(_form_refusals(form), alternatives=form.choices)
        override = form.cleaned_data.get("override", "")
        services.booking_move(version=version, slot=form.slot, override=override, **common)


def _booking_page(request: HttpRequest, found: Booking, error: BookingRefused | None = None) -> HttpResponse:
    person = person_of(request)
    now = timezone.now()
    [row] = _rows([found], [found.robot], person, now)
    manages = may_manage_booking(person, found)
    typed, chosen = request.POST, request.GET  # after a refused move, people need not type it again
    initial = {
        "robot": found.robot.slug,
        "starts_at": typed.get("starts_at") or chosen.get("from") or found.starts_at,
        "ends_at": typed.get("ends_at") or chosen.get("to") or found.ends_at,
    }
    free = services.alternatives_of(error) if error else []
    form = SlotForm(initial=initial, **_form_options(person, found.robot))
    context = {
        "row": row,
        "booking": found,
        "form": form,
        "refusals": error.refusals if error else [],
        "alternatives": _offers(free, reverse("booking", args=[found.pk])),
        "manages": manages,
        "may_change": (manages or found.person_id == person.pk) and row["stage"] in OPEN,
        "begun": now >= found.starts_at,
        "awaits": row["stage"] is Stage.AWAITING,
        "zone": viewers().key,
        "sessions": _sessions_of(found, person),
        "opens": robots_visible_to(person).filter(pk=found.robot_id).exists(),
        "in_line": leads(person, found) or shares(found, person),
        "team": teams_of([found]).get(found.pk, []) if row["person"] else [],
        "colleagues": handing.colleagues_of(person, found) if row["stage"] in OPEN else [],
        "asked": handing.offer_of(found, now),
        "asked_to_share": handing.asked_to_share(found, now) if row["person"] else [],
        "of_course": courses_managed_by(person).filter(bookings=found).first(),
    }
    return render(request, "bookings/booking.html", context, status=409 if error else 200)


def _sessions_of(booking: Booking, viewer: User) -> Any:
    """Return the control sessions in a slot that the viewer may read: supervisors all, others their own.

    They are read by a relation of the robot, because their app, `teleop`, is above this one.
    """
    sessions = booking.robot.control_sessions.filter(started_at__lt=booking.ends_at)
    if not supervises(viewer, booking.robot):
        sessions = sessions.filter(user=viewer)
    sessions = sessions.filter(Q(ended_at=None) | Q(ended_at__gt=booking.starts_at))
    return sessions.select_related("user").order_by("started_at")


# --- helpers --------------------------------------------------------------------------------------


def _rows(found: Iterable[Booking], robots: Any, viewer: User, now: datetime) -> list[dict[str, Any]]:
    """Return the rows of a list. The person of a row is None where the viewer may not read it."""
    policies, reader = policies_of(list(robots)), reader_of(viewer)
    rows = []
    for one in found:
        stage = stage_of(one, grace_of(policies[one.robot_id]), now)
        row = {"booking": one, "stage": stage, "words": _in_words(one), "begun": one.starts_at <= now}
        row["recorded"] = is_recorded(one)
        rows.append({**row, "person": one.person if shows_person(reader, one, stage) else None})
    return rows


def _in_words(booking: Booking) -> str:
    return _slot_words(booking.robot, Slot(booking.starts_at, booking.ends_at))


def _form_options(person: User, robot: Robot | None = None) -> dict[str, Any]:
    """Return the robots to choose from, and whether the person may book for others or against the policy."""
    if robot is None:
        visible, role = bookable_by(person)
        above = role is not None and role >= Role.SUPERVISOR
        overrides = above and robots_managed_by(person).exists()
        teaches = courses_managed_by(person).filter(archived=False, ends_on__gte=lab_date())
        options = {"visible": visible, "supervises": above, "overrides": overrides}
        return {**options, "teaches": teaches if above else ()}
    manages = manages_robot(person, robot)
    return {"visible": {robot.pk}, "supervises": manages, "overrides": manages}


def _typed(request: HttpRequest, person: User) -> SlotForm:
    """Return the form as the person sent it."""
    options = _form_options(person)
    if "course" in request.POST:
        options["courses"] = _courses_to_choose(person)
    return SlotForm(request.POST, **options)


def _courses_to_choose(person: User) -> QuerySet[Course] | None:
    """Return the courses that let the person drive robots, if there are several."""
    courses = Course.objects.filter(
        enrolments__person=person, role=Role.OPERATOR, archived=False, ends_on__gte=lab_date()
    )
    return courses if courses.count() > 1 else None


def _initial(request: HttpRequest) -> dict[str, Any]:
    """Return the initial values of the form: from the URL, else one hour from the next full hour."""
    hour = (timezone.now() + timedelta(hours=1)).replace(minute=0, second=0, microsecond=0)
    return {
        "robot": request.GET.get("robot", ""),
        "starts_at": request.GET.get("from") or hour,
        "ends_at": request.GET.get("to") or hour + timedelta(hours=1),
    }


def _form_page(request: HttpRequest, form: SlotForm, status: int = 200, **context: Any) -> HttpResponse:
    context |= {"form": form, "zone": viewers().key, "left": left_of(person_of(request), timezone.now())}
    return render(request, "bookings/new.html", context, status=status)


def _form_refusals(form: SlotForm) -> list[Refusal]:
    return [
        Refusal(
            error.code or "invalid",
            say("{label}: {messages}", label=form.fields[name].label, messages=error.messages[0]),
            "booking",
        )
        for name, errors in form.errors.as_data().items()
        for error in errors
    ]


def _refused(
    request: HttpRequest,
    form: SlotForm,
    refusals: list[Refusal],
    alternatives: list[tuple[Robot, Slot]] | None = None,
) -> HttpResponse:
    if wants_json(request):
        return JsonResponse(_refusals_json(refusals, alternatives or []), status=409)
    offers = _offers(alternatives or [], reverse("booking-new"))
    can_wait = [refusal.code for refusal in refusals] == ["taken"]
    return _form_page(request, form, 409, refusals=refusals, alternatives=offers, can_wait=can_wait)


def _refusals_json(refusals: list[Refusal], alternatives: list[tuple[Robot, Slot]]) -> dict[str, Any]:
    return {
        "refusals": [{"figures": {}, **wire.to_builtins(one)} for one in refusals],
        "alternatives": [
            {
                "robot": robot.slug,
                "words": _slot_words(robot, slot),
                "start": typed_time(slot.starts_at),
                "end": typed_time(slot.ends_at),
            }
            for robot, slot in alternatives
        ],
    }


def _slot_words(robot: Robot, slot: Slot) -> str:
    return f"{robot.name}, {from_to(slot, viewers())}"


def _offers(free: list[tuple[Robot, Slot]], form: str) -> list[dict[str, str]]:
    """Return free slots as texts, each with the URL of a form that has its times filled in."""
    return [{"words": _slot_words(*one), "address": _filled_in(form, *one)} for one in free]


def _filled_in(form: str, robot: Robot, slot: Slot) -> str:
    times = {"from": typed_time(slot.starts_at), "to": typed_time(slot.ends_at)}
    return f"{form}?{urlencode({'robot': robot.slug, **times})}"


def _text(typed: QueryDict, name: str) -> str:
    """Return a typed text without NUL characters, which PostgreSQL refuses."""
    return typed.get(name, "").replace("\0", "").strip()


def _whole(text: str | None, otherwise: int) -> int:
    return int(text) if text and text.isascii() and text.isdigit() and len(text) < 6 else otherwise


# --- the waiting list -----------------------------------------------------------------------------


@require_POST
def waiting(request: HttpRequest) -> HttpResponse:
    """Join the waiting list of a slot, or leave it."""
    person = person_of(request)
    if leave := request.POST.get("leave"):
        waiting_leave(person=person, waiting_id=_whole(leave, 0))
        messages.success(request, _("You no longer wait for this slot."))
        return redirect("bookings-mine")
    form = _typed(request, person)
    if not form.is_valid():
        return _refused(request, form, _form_refusals(form), form.choices if wants_json(request) else None)
    robot = form.cleaned_data["robot"]
    if form.cleaned_data.get("person", "") not in ("", person.username):
        return _refused(request, form, [_ONLY_ONESELF])
    try:
        waiting_join(
            robot=robot,
            person=person,
            slot=form.slot,
            now=timezone.now(),
            purpose=form.cleaned_data["purpose"],
            course=form.cleaned_data.get("course"),
            record_it=form.cleaned_data["record"],
        )
    except BookingRefused as error:
        return _refused(request, form, error.refusals)
    if wants_json(request):
        return JsonResponse({"robot": robot.slug})
    messages.success(request, _("You wait for this slot. You get an offer when it becomes free."))
    return redirect("bookings-mine")


# --- calendar programs ----------------------------------------------------------------------------


@require_POST
def feed_address(request: HttpRequest) -> HttpResponse:
    """Make a private calendar address, or end it. The new address is shown only once."""
    person = person_of(request)
    slug = _text(request.POST, "robot")
    robot = get_object_or_404(robots_bookable_by(person), slug=slug) if slug else None
    if request.POST.get("action") == "end":
        address_revoke(person=person, robot=robot)
        messages.success(request, _("The address no longer works."))
        return redirect("bookings-mine")
    token = address_make(person=person, robot=robot, now=timezone.now())
    address = public_url(request, reverse("bookings-ical", args=[token]))
    return render(request, "bookings/address.html", {"address": address, "robot": robot})


@login_not_required
@never_cache
@require_safe
def ical(_request: HttpRequest, token: str) -> HttpResponse:
    """Return the feed at a private address, for calendar programs."""
    found = feed_of(token, timezone.now())
    if found is None:
        raise Http404
    return HttpResponse(found, content_type="text/calendar; charset=utf-8")
