"""The pages of booking policies and out-of-service periods, for supervisors of a robot and staff."""

from __future__ import annotations

import csv
from datetime import timedelta
from typing import Any
from uuid import UUID

from django.contrib import messages
from django.core.exceptions import PermissionDenied
from django.db.models import Q
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from fleet.accounts.requests import person_of
from fleet.audit.reading.exports import BOM
from fleet.base.web.time_takers import may_take_time
from fleet.base.zones import viewers, zone_of
from fleet.bookings.changes import policy_changes as policy_services
from fleet.bookings.changes.series import Week, preview, series_make, weekly
from fleet.bookings.changes.whole_series import series_to_come
from fleet.bookings.hours.report import BY, lines, report
from fleet.bookings.models import Booking, OutOfService, Policy
from fleet.bookings.pages.forms import OutOfServiceForm, PolicyForm, SeriesForm, typed_day
from fleet.bookings.rules import Slot, day_of, from_to
from fleet.bookings.selectors import policies_of, policy_of
from robots.access.models import Course, RobotGroup
from robots.access.selectors import (
    courses_managed_by,
    manages_robot,
    robots_managed_by,
    robots_of,
    robots_supervised_by,
    robots_visible_to,
)
from robots.registry.models import Robot


@never_cache
@require_safe
def policies(request: HttpRequest) -> HttpResponse:
    """List the policies, and the out-of-service periods that are not over."""
    robots = _managed(request)
    return _policies_page(request, robots, _out_form(robots))


def _policies_page(request: HttpRequest, robots: list[Robot], form: OutOfServiceForm) -> HttpResponse:
    found = policies_of(robots)
    now = timezone.now()
    periods = OutOfService.objects.filter(Q(ends_at=None) | Q(ends_at__gt=now), robot__in=robots)
    context = {
        "rows": [{"robot": robot, "policy": found[robot.id]} for robot in robots],
        "groups": RobotGroup.objects.select_related("booking_policy") if person_of(request).is_staff else [],
        "periods": periods.select_related("robot"),
        "form": form,
        "zone": viewers().key,
    }
    return render(request, "bookings/policies/policies.html", context, status=400 if form.errors else 200)


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
@may_take_time
def policy(request: HttpRequest, slug: str = "") -> HttpResponse:
    """Show and change the policy of one robot, or the policy of all robots (`slug` empty; staff only)."""
    if not slug:
        return _policy_page(request)
    robot = next((one for one in _managed(request) if one.slug == slug), None)
    if robot is None:
        raise PermissionDenied("Only a supervisor of this robot or staff may change its policy.")
    return _policy_page(request, robot=robot)


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
@may_take_time
def group_policy(request: HttpRequest, slug: str) -> HttpResponse:
    """Show and change the policy of a group. Only for staff: its robots may have different supervisors."""
    return _policy_page(request, group=get_object_or_404(RobotGroup, slug=slug))


def _policy_page(
    request: HttpRequest, robot: Robot | None = None, group: RobotGroup | None = None
) -> HttpResponse:
    person = person_of(request)
    if robot is None and not person.is_staff:
        raise PermissionDenied("Only staff change the policy of several robots.")
    stored = Policy.objects.filter(robot=robot, group=group).first()
    followed = policy_of(robot) if robot else Policy.objects.filter(robot=None, group=None).first()
    copies = "copy" in request.POST
    typed = PolicyForm.with_copied(request.POST) if copies else request.POST or None
    form = PolicyForm(typed, instance=stored or followed or Policy())
    if request.method == "POST" and request.POST.get("action") == "remove":
        policy_services.policy_remove(robot=robot, group=group, actor=person)
        messages.success(request, _("%s follows the common policy again.") % (robot or group))
        return redirect("booking-policies")
    if request.method == "POST" and not copies and form.is_valid():
        policy_services.policy_set(robot=robot, group=group, values=form.cleaned_data, actor=person)
        messages.success(request, _("The booking policy is saved."))
        return redirect("booking-policies")
    context = {
        "form": form,
        "of": robot or group,
        "robot": robot,
        "own": stored is not None,
        "followed": followed,
    }
    return render(
        request, "bookings/policies/policy.html", context, status=400 if form.errors and not copies else 200
    )


@require_POST
@may_take_time
def out_of_service(request: HttpRequest) -> HttpResponse:
    """Add an out-of-service period."""
    robots = _managed(request)
    form = _out_form(robots, request)
    if not form.is_valid():
        return _policies_page(request, robots, form)
    period = {**form.cleaned_data}
    chosen, now = period.pop("robots"), timezone.now()
    for robot in chosen:
        policy_services.out_of_service_add(robot=robot, **period, actor=person_of(request), now=now)
    names = ", ".join(robot.name for robot in chosen)
    messages.success(request, _("Out of service: %(robots)s.") % {"robots": names})
    return redirect("booking-policies")


@require_POST
def out_of_service_end(request: HttpRequest, period_id: UUID) -> HttpResponse:
    """End an out-of-service period now."""
    period = get_object_or_404(OutOfService, pk=period_id, robot__in=_managed(request))
    policy_services.out_of_service_end(period_id=period.pk, actor=person_of(request), now=timezone.now())
    messages.success(request, _("%(robot)s is back in service.") % {"robot": period.robot.name})
    return redirect("booking-policies")


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def series(request: HttpRequest) -> HttpResponse:
    """Preview weekly series with their refusals, one for each chosen robot; then book them."""
    person, now = person_of(request), timezone.now()
    choice = robots_supervised_by(person)
    if not choice:
        raise PermissionDenied("Weekly series are for supervisors and staff.")
    courses = courses_managed_by(person).filter(archived=False)
    overrides = robots_managed_by(person).exists()
    form = SeriesForm(
        request.POST or None,
        robots=choice,
        courses=courses,
        overrides=overrides,
        initial=_lessons_of(courses.filter(slug=request.GET.get("course", "")).first()),
    )
    if request.method != "POST" or not form.is_valid():
        return _series_page(request, form, status=400 if form.errors else 200)
    values = form.cleaned_data
    override, robots = values.get("override", ""), list(values["robot"])
    common: dict[str, Any] = {
        "person": person,
        "slots": weekly(Slot(values["starts_at"], values["ends_at"]), values["weeks"], values["without"]),
        "now": now,
    }
    if request.POST.get("action") != "book":
        common["lesson"] = values["course"] is not None
        weeks = [
            (robot, week)
            for robot in robots
            for week in preview(
                **common, robot=robot, override=bool(override) and manages_robot(person, robot)
            )
        ]
        return _series_page(request, form, weeks=weeks, names=len(robots) > 1)
    common |= {name: values[name] for name in ("purpose", "course", "turn_min")}
    common["record_it"] = values["record"]
    made: list[Booking] = []
    left = 0
    for robot in robots:
        booked, left_out = series_make(**common, robot=robot, actor=person, override=override)
        made, left = [*made, *booked], left + len(left_out)
    text = _("Booked %(made)d slots; left out: %(left)d.") % {"made": len(made), "left": left}
    messages.success(request, text)
    if len({booking.series for booking in made}) == 1:
        return redirect("booking-whole-series", series=made[0].series)
    if made and values["course"]:
        return redirect("bookings-course", slug=values["course"].slug)
    return redirect("booking-series")


def _lessons_of(course: Course | None) -> dict[str, Any]:
    """Return the initial values of a series of lessons: the course and its robots."""
    if course is None:
        return {}
    return {"course": course.slug, "robot": [one.slug for one in robots_of(course)], "purpose": course.name}


def _series_page(
    request: HttpRequest,
    form: SeriesForm,
    weeks: list[tuple[Robot, Week]] | None = None,
    *,
    names: bool = False,
    status: int = 200,
) -> HttpResponse:
    zone = viewers()
    rows = [
        {
            "robot": robot.name if names else "",
            "words": from_to(week.slot, zone) if week.slot else f"{week.day:%a %d %b %Y}",
            "refusals": week.refusals,
        }
        for robot, week in weeks or ()
    ]
    context = {
        "form": form,
        "rows": rows,
        "zone": zone.key,
        "lab": zone_of("").key,
        "stored": series_to_come(person_of(request), timezone.now()),
    }
    return render(request, "bookings/policies/series.html", context, status=status)


@never_cache
@require_safe
def booking_report(request: HttpRequest) -> HttpResponse:
    """Show booked hours, used hours and unused slots of a period, by robot, person or course; also as CSV."""
    person, zone, now = person_of(request), viewers(), timezone.now()
    robots, courses = robots_managed_by(person), courses_managed_by(person)
    if not (person.is_staff or robots or courses):
        raise PermissionDenied("The report is for supervisors and staff.")
    today = now.astimezone(zone).date()
    term = courses.filter(slug=request.GET.get("course", "")).first()
    first = typed_day(request.GET.get("from")) or (term.starts_on if term else today - timedelta(days=30))
    last = typed_day(request.GET.get("to")) or (term.ends_on if term else today)
    by = request.GET.get("by", "robot")
    by = by if by in BY else "robot"
    starts, ends = day_of(min(first, last), zone).starts_at, day_of(max(first, last), zone).ends_at
    whose = request.GET.get("person", "").replace("\0", "").strip()
    choice = robots_visible_to(person)
    robot = choice.filter(slug=request.GET.get("robot", "").replace("\0", "")).first()
    only = Q(robot=robot) if robot else Q()
    scope = ((), [term]) if term else (robots, courses)
    rows = report(*scope, starts=starts, ends=ends, by=by, now=now, only=only, whose=whose)
    if request.GET.get("as") == "csv":
        answer = HttpResponse(content_type="text/csv; charset=utf-8")
        answer["Content-Disposition"] = f'attachment; filename="bookings-{by}-{first}-{last}.csv"'
        answer.write(BOM)
        csv.writer(answer).writerows(lines(rows))
        return answer
    context = {
        "rows": rows,
        "by": by,
        "choices": BY,
        "courses": courses,
        "term": term,
        "robots": choice,
        "robot": robot,
        "whose": whose,
        "first": first,
        "last": last,
        "zone": zone.key,
    }
    return render(request, "bookings/policies/report.html", context)


def _managed(request: HttpRequest) -> list[Robot]:
    robots = list(robots_managed_by(person_of(request)))
    if not robots and not person_of(request).is_staff:
        raise PermissionDenied("Booking policies are for supervisors of a robot and staff.")
    return robots


def _out_form(robots: list[Robot], request: HttpRequest | None = None) -> OutOfServiceForm:
    choice = Robot.objects.filter(pk__in=[robot.pk for robot in robots])
    if request is not None:
        return OutOfServiceForm(request.POST, robots=choice)
    now = timezone.now().replace(second=0, microsecond=0)
    return OutOfServiceForm(robots=choice, initial={"starts_at": now})
