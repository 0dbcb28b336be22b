"""News about one's bookings, as notices on the pages."""

from __future__ import annotations

from typing import Any

from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect
from django.utils import timezone
from django.utils.functional import SimpleLazyObject
from django.utils.http import url_has_allowed_host_and_scheme
from django.views.decorators.http import require_POST

from fleet.accounts.models import User
from fleet.accounts.requests import person_of
from fleet.bookings.messages.notifications import notifications_seen, notifications_unseen
from fleet.bookings.models import Notification


def news(request: HttpRequest) -> dict[str, Any]:
    """Return the person's unseen notifications for templates. They are read only if a template shows them."""
    return {"news": SimpleLazyObject(lambda: _unseen_by(person_of(request)))}


def _unseen_by(person: User) -> list[Notification]:
    return notifications_unseen([person.pk], timezone.now())[person.pk]


@require_POST
def seen(request: HttpRequest) -> HttpResponse:
    """Note that the person has seen their notifications, and redirect to the page."""
    newest = request.POST.get("newest", "")
    if newest.isascii() and newest.isdigit() and len(newest) < 19:
        notifications_seen(person_of(request), int(newest), timezone.now())
    back = request.POST.get("next", "")
    return redirect(back if url_has_allowed_host_and_scheme(back, None) else "fleet")
