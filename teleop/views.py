"""The fleet page, the fleet map, the control page and its file of places."""

from __future__ import annotations

import json
from codecs import BOM_UTF8

from django.conf import settings
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import render
from django.views.decorators.gzip import gzip_page
from django.views.decorators.http import require_safe

from fleet.accounts.requests import person_of
from robots.access.selectors import (
    courses_to_come,
    robot_visible_to,
    robots_visible_to,
    roles_of,
    supervises,
)
from robots.places.selectors import map_among
from robots.places.services import places_export
from robots.registry.models import Role
from robots.registry.selectors import robot_facts
from robots.shared.wire import PROTOCOL


@require_safe
@gzip_page  # of random length: the length tells nothing about a secret on the page
def fleet(request: HttpRequest) -> HttpResponse:
    """Show a card for each robot that this person may see; with `?wall`, large cards without buttons."""
    person = person_of(request)
    robots = robots_visible_to(person)
    if "wall" not in request.GET:
        context = {"robots": robots, "to_come": courses_to_come(person)}
        return render(request, "teleop/fleet/fleet.html", context)
    only_watches = set(roles_of(person, robots).values()) <= {Role.OBSERVER} and not person.is_staff
    return render(request, "teleop/fleet/wall.html", {"robots": robots, "stays": only_watches})


@require_safe
def plan(request: HttpRequest) -> HttpResponse:
    """Show the robots that this person may see on their maps; the page's script receives their positions."""
    return render(request, "teleop/fleet/plan.html", {"robots": robots_visible_to(person_of(request))})


@require_safe
@gzip_page  # of random length: the length tells nothing about a secret on the page
def control(request: HttpRequest, slug: str) -> HttpResponse:
    """Show the control page of one robot, for driving or watching."""
    person = person_of(request)
    robot = robot_visible_to(person, slug)
    context = {
        "robot": robot,
        "has_cameras": bool(robot_facts(robot).cameras),
        "has_lichtblick": settings.FLEET_LICHTBLICK is not None,
        "supervises": supervises(person, robot),
        "protocol": PROTOCOL,
        "choices": json.dumps(person.page_choices),
    }
    return render(request, "teleop/control/control.html", context)


@require_safe
def places_file(request: HttpRequest, digest: str) -> HttpResponse:
    """Send the places of a map for a spreadsheet: the API's file, with a byte order mark for Excel."""
    if map_among(robots_visible_to(person_of(request)), digest) is None:
        raise Http404
    answer = HttpResponse(BOM_UTF8 + places_export(digest).encode(), content_type="text/csv; charset=utf-8")
    answer["Content-Disposition"] = f'attachment; filename="places-{digest[:8]}.csv"'
    return answer
