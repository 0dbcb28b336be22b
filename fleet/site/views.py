"""Pages of the project itself."""

from __future__ import annotations

from functools import cache

from django.conf import settings
from django.contrib.auth.decorators import login_not_required
from django.contrib.auth.views import redirect_to_login
from django.core.exceptions import PermissionDenied
from django.db import DatabaseError, connection
from django.db.migrations.executor import MigrationExecutor
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import redirect, render
from django.urls import reverse
from django.utils.translation import gettext_lazy as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_safe

from fleet.audit.kinds import Kept

WHY_KEPT = {
    Kept.SPEECH: _("So that a sentence can be traced to whoever had a robot say it."),
    Kept.DRIVING: _("So that it can be seen where a robot drove, how fast, and what its gate held back."),
    Kept.OTHER: _(
        "Reasons, names, addresses and browsers: so that misuse of accounts and rights comes to light."
    ),
}


def not_found(request: HttpRequest, exception: Exception) -> HttpResponse:
    """Django's handler of 404. Its own one reads the request's body, which fails again if that is broken."""
    return render(request, "404.html", status=404)


@login_not_required
def admin_login(request: HttpRequest) -> HttpResponse:
    """Where Django's admin sends whoever may not see it. To sign in there is one door, and it is not here."""
    if not request.user.is_authenticated:
        return redirect_to_login(request.GET.get("next", reverse("admin:index")))
    if request.user.is_staff:
        return redirect("admin:index")
    raise PermissionDenied("The admin pages are for staff.")


@login_not_required
@require_safe
def cookies(request: HttpRequest) -> HttpResponse:
    """Which cookies are kept, and why."""
    names = {"session": settings.SESSION_COOKIE_NAME, "csrf": settings.CSRF_COOKIE_NAME}
    hours = settings.SESSION_COOKIE_AGE // 3600
    return render(request, "cookies.html", {"names": names, "session_hours": hours})


@login_not_required
@require_safe
def privacy(request: HttpRequest) -> HttpResponse:
    """What is kept of people, why, and for how long."""
    records_days = settings.FLEET_AUDIT_KEEP_RECORDS_DAYS
    days = {kept: min(settings.FLEET_AUDIT_KEEP_DAYS[kept.value], records_days) for kept in Kept}
    classes = [{"what": kept.label, "why": WHY_KEPT[kept], "days": days[kept]} for kept in Kept]
    return render(request, "privacy.html", {"classes": classes, "records_days": records_days})


@login_not_required
@never_cache
@require_safe
def healthz(_request: HttpRequest) -> JsonResponse:
    """For monitors: is the database reachable, and is its schema this version's?"""
    try:
        trouble = _trouble()
    except DatabaseError:
        trouble = "The database does not answer."
    return JsonResponse({"ok": trouble is None, "text": trouble or "Ready."}, status=503 if trouble else 200)


def _trouble() -> str | None:
    with connection.cursor() as cursor:
        cursor.execute("SELECT 1")
    try:
        _check_migrations()
    except LookupError as error:
        return str(error)
    return None


@cache  # only success is kept: an applied migration stays applied
def _check_migrations() -> None:
    executor = MigrationExecutor(connection)
    missing = executor.migration_plan(executor.loader.graph.leaf_nodes())
    if missing:
        raise LookupError(f"{len(missing)} migrations are not applied: run manage.py migrate.")
