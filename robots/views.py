"""Pages of the registry."""

from __future__ import annotations

import threading
from collections import defaultdict
from uuid import UUID

from django.core.exceptions import PermissionDenied
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, render
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_safe

from fleet.accounts.models import User
from robots.checks import run_checks
from robots.selectors import robots_visible_to

_probed: dict[UUID, threading.Lock] = defaultdict(threading.Lock)  # one probe of a robot at a time


@never_cache
@require_safe
def robot_check(request: HttpRequest, slug: str) -> HttpResponse:
    """What `manage.py check_robot` says, for everybody who may see the robot."""
    if not isinstance(request.user, User):  # LoginRequiredMiddleware lets in nobody else
        raise PermissionDenied
    robot = get_object_or_404(robots_visible_to(request.user), slug=slug)
    lock = _probed[robot.id]
    if not lock.acquire(blocking=False):
        return render(request, "robots/check.html", {"robot": robot, "answers": [], "busy": True})
    try:
        answers = run_checks(robot)
    finally:
        lock.release()
    return render(request, "robots/check.html", {"robot": robot, "answers": answers})
