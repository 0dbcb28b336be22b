"""The pages *Status* and *Rules*."""

from __future__ import annotations

from datetime import timedelta

from django.contrib import messages
from django.core.exceptions import PermissionDenied
from django.db import transaction
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_safe

from fleet.accounts.requests import person_of, staff_of
from fleet.backup.selectors import last_backup
from robots.access.selectors import robots_visible_to
from teleop.alerts.forms import RuleForm
from teleop.alerts.history import lines
from teleop.alerts.kinds import KINDS
from teleop.alerts.rules import rule_save, rules
from teleop.alerts.telling import readers
from teleop.alerts.watch import knows, look_age_s
from teleop.models import Alert, AlertRule

SHOWN = 50  # newest alerts


@never_cache
@require_safe
def status(request: HttpRequest) -> HttpResponse:
    """Show how robots are and were; to staff also the console's parts, and the newest alerts."""
    person = person_of(request)
    robots = list(robots_visible_to(person).filter(enabled=True).order_by("name"))
    if not (robots or person.is_staff):
        raise PermissionDenied("You see no robot: ask staff for a role.")
    newest = Alert.objects.select_related("robot")
    context = {
        "lines": lines(robots, console=person.is_staff),
        "alerts": (newest if person.is_staff else newest.filter(robot__in=robots))[:SHOWN],
        "kinds": {name: kind.label for name, kind in KINDS.items()},
        "looked_at": None if (age_s := look_age_s()) is None else timezone.now() - timedelta(seconds=age_s),
        "knows": knows(),
        "unread": person.is_staff and not readers(AlertRule()),
        "backup": last_backup() if person.is_staff else None,
    }
    return render(request, "teleop/alerts/status.html", context)


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def alert_rules(request: HttpRequest) -> HttpResponse:
    """Show and change who is told of which kind of alert, and when."""
    staff = staff_of(request, "Only staff change the rules of alerts.")
    posted = request.POST if request.method == "POST" else None
    forms = [RuleForm(posted, instance=rule, prefix=name) for name, rule in rules().items()]
    if posted is not None and all([form.is_valid() for form in forms]):  # noqa: C419 - each says its faults
        with transaction.atomic():
            for form in forms:
                if form.has_changed():
                    rule_save(form.instance, staff)
        messages.success(request, _("The rules are saved."))
        return redirect("alert-rules")
    context = {"forms": forms, "unread": not readers(AlertRule())}
    return render(request, "teleop/alerts/rules.html", context, status=400 if posted else 200)
