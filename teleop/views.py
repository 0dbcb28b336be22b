"""The pages, and the stop that works without a live connection."""

from __future__ import annotations

from collections.abc import Sequence

from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import render
from django.utils.translation import gettext as _
from django.views.decorators.http import require_POST, require_safe

from fleet.accounts.requests import person_of, wants_json
from robots.models import Robot
from robots.selectors import robot_seen_by, robots_visible_to, supervises
from robots.stops import Pending
from robots.wire import PROTOCOL, Refusal
from teleop import stopping


@require_safe
def fleet(request: HttpRequest) -> HttpResponse:
    """A card for each robot that this person may see."""
    return render(request, "teleop/fleet.html", {"robots": robots_visible_to(person_of(request))})


@require_safe
def control(request: HttpRequest, slug: str) -> HttpResponse:
    """One robot: drive it, or watch who does."""
    person = person_of(request)
    robot = robot_seen_by(person, slug)
    told = {"robot": robot, "supervises": supervises(person, robot), "protocol": PROTOCOL}
    return render(request, "teleop/control.html", told)


@require_POST
def stop(request: HttpRequest, slug: str) -> HttpResponse:
    """Emergency stop of one robot."""
    return _stop(request, [robot_seen_by(person_of(request), slug)])


@require_POST
def stop_all(request: HttpRequest) -> HttpResponse:
    """Emergency stop of every robot that this person may see."""
    return _stop(request, list(robots_visible_to(person_of(request)).filter(enabled=True)))


def _stop(request: HttpRequest, robots: Sequence[Robot]) -> HttpResponse:
    """Stop at once; JSON, or a page that needs nothing written: a full disk must not say that nothing was done."""
    outcomes = stopping.press_once(robots, user=person_of(request), through="page")
    unreached = [robot.name for robot, result in outcomes.items() if isinstance(result, Refusal)]
    pending = [robot.name for robot, result in outcomes.items() if isinstance(result, Pending)]
    texts = []
    if unreached:
        texts.append(_("Not reached: %s. Use the red button on the robot.") % ", ".join(unreached))
    if pending:
        words = _(
            "Pending, not confirmed yet: %s. The stop will be delivered as soon as possible. "
            "Use the red button on the robot."
        )
        texts.append(words % ", ".join(pending))
    done = _("Stopped.") if robots else _("There is no robot in service that you may stop.")
    text = " ".join(texts) or done
    by_slug, status = stopping.told(outcomes)
    if wants_json(request):
        return JsonResponse({"text": text, "robots": by_slug}, status=status)
    return render(request, "stopped.html", {"text": text, "robots": robots}, status=status)
