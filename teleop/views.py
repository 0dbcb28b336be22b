"""The pages, and the stop that works without a live connection."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import msgspec
from django.contrib import messages
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils.translation import gettext as _
from django.views.decorators.http import require_POST, require_safe

from fleet.accounts.models import User
from robots.models import Robot
from robots.selectors import robots_visible_to
from robots.wire import Refusal
from teleop import stopping
from teleop.services import supervises_robot


@require_safe
def fleet(request: HttpRequest) -> HttpResponse:
    """A card for each robot that this person may see."""
    return render(request, "teleop/fleet.html", {"robots": robots_visible_to(_person(request))})


@require_safe
def control(request: HttpRequest, slug: str) -> HttpResponse:
    """One robot: drive it, or watch who does."""
    robot = _visible(request, slug)
    supervises = supervises_robot(user=_person(request), robot=robot)
    return render(request, "teleop/control.html", {"robot": robot, "supervises": supervises})


@require_POST
def stop(request: HttpRequest, slug: str) -> HttpResponse:
    """Emergency stop of one robot."""
    return _stop(request, [_visible(request, slug)])


@require_POST
def stop_all(request: HttpRequest) -> HttpResponse:
    """Emergency stop of every robot that this person may see."""
    return _stop(request, list(robots_visible_to(_person(request)).filter(enabled=True)))


def _stop(request: HttpRequest, robots: Sequence[Robot]) -> HttpResponse:
    """Stop at once; 502 if one of them was not reached. JSON, but back to the page with a browser, which names HTML."""
    results = stopping.press_once(robots, user=_person(request), through="page")
    unreached = [
        robot.name for robot, result in zip(robots, results, strict=True) if isinstance(result, Refusal)
    ]
    text = _("Stopped.")
    if unreached:
        text = _("Not reached: %s. Use the red button on the robot.") % ", ".join(unreached)
    if not _wants_json(request):
        (messages.error if unreached else messages.success)(request, text)
        return redirect("control", robots[0].slug) if len(robots) == 1 else redirect("fleet")
    outcomes = {
        robot.slug: msgspec.to_builtins(result) for robot, result in zip(robots, results, strict=True)
    }
    return JsonResponse({"text": text, "robots": outcomes}, status=502 if unreached else 200)


def _wants_json(request: HttpRequest) -> bool:
    return request.get_preferred_type(["application/json", "text/html"]) == "application/json"


def _visible(request: HttpRequest, slug: str) -> Robot:
    return get_object_or_404(robots_visible_to(_person(request)), slug=slug)


def _person(request: HttpRequest) -> User:
    return cast(User, request.user)  # every page needs a signed-in person
