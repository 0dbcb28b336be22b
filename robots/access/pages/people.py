"""Pages that show a person's roles and where these come from."""

from __future__ import annotations

from uuid import UUID

from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, render
from django.utils import timezone
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_safe

from fleet.accounts.models import User
from fleet.accounts.requests import person_of
from robots.access.models import Course, QualificationGrant
from robots.access.pages.tokens import shown_tokens
from robots.access.password_links import may_see
from robots.access.selectors import courses_managed_by, reasons


@never_cache
@require_safe
def my_access(request: HttpRequest) -> HttpResponse:
    """Show a person their own roles, where these come from, and their qualifications."""
    return _access_page(request, person_of(request))


@never_cache
@require_safe
def person(request: HttpRequest, person_id: UUID) -> HttpResponse:
    """Show the same about another person, to staff and to the supervisors of that person's courses."""
    viewer = person_of(request)
    found = get_object_or_404(User, pk=person_id)
    of_mine = courses_managed_by(viewer).filter(enrolments__person=found)
    if found != viewer and not viewer.is_staff and not of_mine.exists():
        raise Http404
    return _access_page(request, found)


def _access_page(request: HttpRequest, shown: User) -> HttpResponse:
    now = timezone.now()
    grants = QualificationGrant.objects.filter(person=shown).select_related("qualification")
    context = {
        "person": shown,
        "own": shown == request.user,
        "reasons": reasons(shown, now) if shown.is_active else [],
        "courses": Course.objects.filter(enrolments__person=shown, archived=False),
        "managed": set(courses_managed_by(person_of(request)).values_list("pk", flat=True)),
        "grants": grants,
        "link_shown": bool(may_see(person_of(request), [shown])),
        "tokens": shown_tokens(shown) if person_of(request).is_staff and shown != request.user else None,
        "now": now,
    }
    return render(request, "access/person.html", context)
