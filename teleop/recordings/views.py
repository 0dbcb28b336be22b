"""Pages of recordings: the list, and the replay of one."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import date
from typing import Any
from uuid import UUID

import msgspec
from django.core.paginator import Page, Paginator
from django.db.models import QuerySet
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils.dateparse import parse_date
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_safe

from fleet.accounts.models import User
from fleet.accounts.requests import person_of
from fleet.base import zones
from fleet.base.durations import duration_text
from robots.access.models import Course
from robots.access.selectors import robots_visible_to
from robots.access.who_sees import Reader, reader_of
from robots.recordings.models import Kind, Recording
from robots.registry.models import RosChoice
from robots.registry.selectors import robot_facts
from teleop.models import ControlSession
from teleop.recordings import times
from teleop.recordings.lines import EVENTS, Event, events_of, lines
from teleop.recordings.listing import Filters, filtered
from teleop.recordings.logged import logged
from teleop.recordings.selectors import Sight, recordings_of, sessions_in, sight_of

ROWS = 25
SPEEDS = (0.25, 0.5, 1, 2, 4, 8)  # of the replay
BEFORE_EVENT_S = 30.0  # the replay of a black box begins so long before its first event
MOST_TEXT = 100  # characters of a filter


@never_cache
@require_safe
def recordings(request: HttpRequest) -> HttpResponse:
    """List the recordings of which this person sees at least a part; the filters are in the address."""
    person = person_of(request)
    reader = reader_of(person)
    filters, first, last = _filters(request)
    found = filtered(person, reader, filters).select_related("robot__profile", "person").defer("topics")
    page: Page[Recording] = Paginator(found, ROWS).get_page(request.GET.get("page"))
    context = {
        "page": page,
        "lines": lines(person, list(page), reader, filters.event),
        "filters": filters,
        "first": first,
        "last": last,
        "is_filtered": filters != Filters(),
        "robots": robots_visible_to(person),
        "kinds": Kind.choices,
        "events": EVENTS.items(),
        "courses": Course.objects.filter(slug__in=_courses(person, reader)).order_by("name"),
    }
    return render(request, "teleop/recordings/recordings.html", context)


@never_cache
@require_safe
def recording(request: HttpRequest, recording_id: UUID) -> HttpResponse:
    """Show a recording: replay, downloads, and what may be done with it."""
    person = person_of(request)
    reader = reader_of(person)
    found = Recording.objects.filter(pk=recording_id).select_related("robot__profile", "person").first()
    sight = sight_of(person, found, reader) if found else None
    if found is None or sight is None:
        raise Http404("There is no such recording, or you may not see it.")
    others = recordings_of(person, reader)
    events, is_box = events_of(sight), found.kind == Kind.BLACK_BOX
    records, more = logged(person, sight, reader)
    shares = found.shares.select_related("person", "course") if sight.may_change else []
    context = {
        "recording": found,
        "sight": sight,
        "earlier": others.filter(pk=found.continues) if found.continues else [],
        "later": others.filter(continues=found.pk),
        "lasts": duration_text((found.ends_at - found.begins_at).total_seconds()),
        "sessions": list(_sessions(sight, person.pk)),
        "shares": shares,
        "speeds": SPEEDS,
        "is_ros2": found.robot.profile.ros == RosChoice.TWO,
        "more": more,
        "replay": {
            "address": f"/api/v1/recordings/{found.pk}",
            "beganAt": found.begins_at.isoformat(),
            "lastsS": (found.ends_at - found.begins_at).total_seconds(),
            "facts": msgspec.to_builtins(robot_facts(found.robot)),
            "beginS": max(events[0].at_s - BEFORE_EVENT_S, 0.0) if is_box and events else 0.0,
            "events": [_shown(one) for one in sorted([*events, *records], key=lambda one: one.at_s)],
            "sees": [[times.since(found, begin), times.since(found, end)] for begin, end in sight.parts],
        },
    }
    return render(request, "teleop/recordings/recording.html", context)


def _shown(event: Event) -> dict[str, Any]:
    """Return an event for the timeline."""
    return {
        "atS": event.at_s,
        "event": event.event,
        "what": event.what,
        "text": event.text,
        "by": event.by,
        "isLogged": event.is_logged,
    }


def _sessions(sight: Sight, person: UUID) -> Iterator[ControlSession]:
    """Yield the control sessions that the person sees in it."""
    for session in sessions_in(sight.recording):
        if sight.whole or session.user_id == person:
            yield session


def _courses(person: User, reader: Reader) -> QuerySet[Any, Any]:
    """Return the slugs of the courses that recordings of this person may have."""
    return recordings_of(person, reader).exclude(course="").order_by().values("course").distinct()


def _filters(request: HttpRequest) -> tuple[Filters, date | None, date | None]:
    """Return the filters of the address, with the first and the last day."""
    text = {name: request.GET.get(name, "").replace("\0", "").strip()[:MOST_TEXT] for name in request.GET}
    first, last = _day(text.get("from")), _day(text.get("to"))
    zone = zones.viewers()
    filters = Filters(
        text.get("robot", ""),
        text.get("person", ""),
        text.get("course", ""),
        text.get("kind", ""),
        text.get("event", ""),
        text.get("topic", ""),
        zones.start_of(first, zone) if first else None,
        zones.end_of(last, zone) if last else None,
        text.get("q", ""),
    )
    return filters, first, last


def _day(text: str | None) -> date | None:
    """Return a day; None: there is none, or it is no date in the years of this calendar."""
    try:
        day = parse_date(text) if text else None
    except ValueError:
        return None
    return day if day and 1970 <= day.year < date.max.year else None
