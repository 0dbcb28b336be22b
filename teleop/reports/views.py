"""Report pages: a control session, a robot's use, a person's own data."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, date, datetime, timedelta
from itertools import pairwise
from typing import Any
from uuid import UUID

from django.conf import settings
from django.core.exceptions import BadRequest, PermissionDenied
from django.http import Http404, HttpRequest, HttpResponse, HttpResponseBase
from django.shortcuts import get_object_or_404, render
from django.utils.dateparse import parse_date, parse_datetime
from django.utils.dates import WEEKDAYS
from django.utils.timezone import is_aware, now
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy
from django.views.decorators.cache import cache_control, never_cache
from django.views.decorators.http import require_POST, require_safe
from msgspec import Struct, structs

from fleet.accounts.models import User
from fleet.accounts.requests import person_of
from fleet.audit.reading import wording
from fleet.audit.reading.addresses import number, session_url_of
from fleet.audit.reading.exports import BOM
from fleet.audit.reading.listing import Row
from fleet.base import zones
from fleet.base.formats.sentences import in_words, localised
from fleet.bookings.permissions import awaiting_approval
from robots.access.selectors import courses_managed_by, robot_visible_to, supervises
from robots.access.who_sees import reader_of
from teleop.control.selectors import end_notes
from teleop.recordings.lines import lines_of_session
from teleop.reports import marks, own_data, path_plot, robot_report, session_report, today
from teleop.reports.session_maps import maps_of

_AUTHORS = {
    own_data.Author.CONSOLE: gettext_lazy("by the console itself"),
    own_data.Author.OTHER: gettext_lazy("by another person"),
    own_data.Author.UNKNOWN: gettext_lazy("by a person who failed to sign in"),
}
ONE_DAY = timedelta(days=1)
MAP_CACHED_S = 60 * 60  # in the browser; the picture with this number never changes


class RecordLine(Struct, frozen=True):
    """A record as a line of the page; `subject` is the spoken text, or the facts of a record by others."""

    at: datetime
    robot: str
    what: str
    subject: str
    outcome: str
    expired: bool
    session_url: str
    by: str = ""


@never_cache
@require_safe
def control_session(request: HttpRequest, session_id: UUID) -> HttpResponse:
    """Show a control session to its holder, supervisors of the robot and staff."""
    person = person_of(request)
    session = session_report.session_visible_to(person, session_id)
    if session is None:
        raise Http404("There is no such control session, or you may not see it.")
    report = session_report.report_of(session)
    reader = reader_of(person)
    context = {
        "report": report,
        "life": session_report.booking_life(session, reader),
        "recordings": lines_of_session(person, session, reader),
        "session": session,
        "note": in_words(end_notes([session.pk]).get(session.pk, "")),
        "supervises": supervises(person, session.robot),
        "kept_days": settings.FLEET_AUDIT_KEEP_DAYS["driving"],
        "size": {"width": path_plot.WIDTH, "height": path_plot.HEIGHT, "grid": 3 * path_plot.WIDTH},
        "paces": _paces(),
        "replay": {
            "lastsS": report.lasted_s,
            "beganAt": session.started_at.isoformat(),
            "drives": report.plot.replay if report.plot else [],
        },
    }
    return render(request, "teleop/reports/session.html", context)


@cache_control(private=True, max_age=MAP_CACHED_S, immutable=True)
@require_safe
def control_session_map(request: HttpRequest, session_id: UUID, number: int) -> HttpResponse:
    """Return the picture of one of the robot's maps of that time, to people who may see the session."""
    session = session_report.session_visible_to(person_of(request), session_id)
    found = maps_of(session).filter(pk=number).first() if session else None
    if found is None:
        raise Http404("There is no such control session or map, or you may not see it.")
    return HttpResponse(bytes(found.picture), content_type="image/png")


@never_cache
@require_safe
def robot(request: HttpRequest, slug: str) -> HttpResponse:
    """Show a robot's use to its supervisors and staff."""
    person = person_of(request)
    asked = robot_visible_to(person, slug)
    if not supervises(person, asked):
        raise PermissionDenied("This report is for supervisors of the robot.")
    days = _period(request)
    report = robot_report.report_of(asked, days, now())
    context = {
        "robot": asked,
        "report": report,
        "days": days,
        "periods": robot_report.PERIODS_DAYS,
        "kept_days": settings.FLEET_AUDIT_KEEP_RECORDS_DAYS,
        "days_driven": [day for day in reversed(report.use.days) if day.hours],
        "busiest": _busiest(report.use),
        "use": {
            "days": [[robot_report.day_start_s(day.day), round(day.hours, 3)] for day in report.use.days],
            "hours": [round(hours, 3) for hours in report.use.hours],
            "weekdays": [round(hours, 3) for hours in report.use.weekdays],
        },
    }
    return render(request, "teleop/reports/robot_report.html", context)


@never_cache
@require_safe
def today_page(request: HttpRequest) -> HttpResponse:
    """Show one day of all robots of which the person is supervisor; staff see every robot."""
    robots = today.supervised_by(person_of(request))
    if not robots and not person_of(request).is_staff:
        raise PermissionDenied("This page is for supervisors and staff.")
    moment = now()
    current = zones.day_of(moment)
    try:
        day = parse_date(request.GET["day"]) if request.GET.get("day") else current
    except ValueError:
        day = None
    if day is None or not 1970 <= day.year < date.max.year:
        raise BadRequest("day is not a date such as 2026-11-23")
    context = {
        "report": today.day_of(robots, day, moment),
        "is_today": day == current,
        "previous": day - ONE_DAY,
        "next": day + ONE_DAY,
        "awaiting": len(awaiting_approval(person_of(request), moment)),
    }
    return render(request, "teleop/reports/today.html", context)


@never_cache
@require_safe
def marks_file(request: HttpRequest, slug: str) -> HttpResponse:
    """Return a CSV file for marks: what each person of a course did. For its supervisors and staff; recorded."""
    person = person_of(request)
    course = get_object_or_404(courses_managed_by(person), slug=slug)
    found = marks.marks_exported(course, person, now())
    answer = HttpResponse(content_type="text/csv; charset=utf-8")
    answer["Content-Disposition"] = f'attachment; filename="marks-{course.slug}-{zones.day_of(now())}.csv"'
    answer.write(BOM)
    csv.writer(answer, delimiter=marks.separator()).writerows(marks.lines(found))
    return answer


@never_cache
@require_safe
def your_data(request: HttpRequest) -> HttpResponse:
    """Show a person their own data."""
    person = person_of(request)
    before, after, viewings = number(request, "before"), number(request, "after"), "viewings" in request.GET
    page = own_data.own_records(person, before=before, after=after, viewings=viewings)
    sessions = own_data.own_sessions(person, _moment(request, "began_before"))
    about = own_data.recorded_by_others(person, number(request, "about_before"))
    context = {
        "sessions": sessions,
        "lines": [_line(row) for row in page.rows],
        "page": page,
        "viewings": viewings,
        "oldest_session": sessions.shown[-1].started_at.isoformat() if sessions.shown else "",
        "newest_number": page.rows[0].number if page.rows else None,
        "oldest_number": page.rows[-1].number if page.rows else None,
        "recordings": own_data.own_recordings(person, _moment(request, "recorded_before")),
        "about": [_line_about(row, person) for row in about.shown],
        "oldest_about": about.shown[-1].number if about.older else None,
    }
    return render(request, "teleop/reports/your_data.html", context)


@require_POST
def your_data_export(request: HttpRequest) -> HttpResponseBase:
    """Return the person's own data as JSON Lines. The export is recorded."""
    return own_data.export_of(person_of(request))


def _line(row: Row) -> RecordLine:
    record = row.record
    return RecordLine(
        at=record.at,
        robot=record.robot_name,
        what=wording.label(record.kind),
        subject=wording.subject(record),
        outcome=wording.outcome(row.outcome),
        expired=wording.expired(record),
        session_url=session_url_of(record.session_id),
    )


def _line_about(row: Row, person: User) -> RecordLine:
    return structs.replace(
        _line(row),
        subject=" · ".join(_facts_about(own_data.visible_details(row, person), person)),
        session_url="",
        by=str(_AUTHORS[own_data.author_of(row.record)]),
    )


def _facts_about(details: dict[str, Any], person: User) -> Iterator[str]:
    """Yield facts in words, without the person: "full name Olga → Olga Operator", "to supervisor"."""
    to_last = sorted(details.items(), key=lambda fact: fact[0] == "to")  # PostgreSQL sorts short names first
    for name, value in to_last:
        if name == "changes":
            for change in value:
                ends = (
                    wording.said(change[end]) for end in ("from", "to") if change.get(end) not in (None, "")
                )
                yield f"{wording.plain(change['field'])} {' → '.join(ends)}".strip()
        elif name != "name" and value != str(person.pk):
            yield wording.figure(name, value)


def _paces() -> list[str]:
    """Return the legend of the colours of a path, slowest first."""
    limits = [localised(limit) for limit in path_plot.SPEEDS_MPS]
    between = [f"{low}–{high}" for low, high in pairwise(limits)]  # noqa: RUF001
    return [_("up to %s") % limits[0], *between, _("above %s m/s") % limits[-1]]


def _busiest(use: robot_report.Usage) -> dict[str, Any] | None:
    """Return the hour and the weekday with the most driving; None without driving."""
    if not any(use.hours):
        return None
    weekday = use.weekdays.index(max(use.weekdays))
    return {"hour": use.hours.index(max(use.hours)), "weekday": WEEKDAYS[weekday]}


def _period(request: HttpRequest) -> int:
    asked = request.GET.get("days", "30")
    if asked not in map(str, robot_report.PERIODS_DAYS):
        raise BadRequest(f"days is one of {robot_report.PERIODS_DAYS}")
    return int(asked)


def _moment(request: HttpRequest, name: str) -> datetime | None:
    asked = request.GET.get(name)
    if asked is None:
        return None
    with suppress(ValueError, OverflowError):
        moment = parse_datetime(asked)
        if moment is not None and is_aware(moment):
            return moment.astimezone(UTC)
    raise BadRequest(f"{name} is not a moment with its time zone")
