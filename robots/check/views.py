"""Pages of the registry."""

from __future__ import annotations

import threading
from collections import defaultdict
from uuid import UUID

from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_safe

from fleet.accounts.requests import person_of
from robots.access.selectors import robot_visible_to
from robots.check.results import FAIL
from robots.check.robot_check import run_checks

_probed: dict[UUID, threading.Lock] = defaultdict(threading.Lock)  # at most one check of a robot at a time


@never_cache
@require_safe
def robot_check(request: HttpRequest, slug: str) -> HttpResponse:
    """Show the result of `manage.py check_robot` to everybody who may see the robot."""
    robot = robot_visible_to(person_of(request), slug)
    lock = _probed[robot.id]
    if not lock.acquire(blocking=False):
        return render(request, "robots/check.html", {"robot": robot, "answers": [], "busy": True})
    try:
        answers = run_checks(robot)
    finally:
        lock.release()
    failures = sum(answer.level == FAIL for answer in answers)
    return render(request, "robots/check.html", {"robot": robot, "answers": answers, "failures": failures})
