"""Sheets of personal links by which people set a password, to show, or to print and cut up."""

from __future__ import annotations

from collections.abc import Sequence
from uuid import UUID

import segno
from django.contrib import messages
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils.safestring import SafeString, mark_safe
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_POST
from msgspec import Struct

from fleet.accounts.models import User
from fleet.accounts.requests import person_of
from fleet.base.web.origin import public_url
from robots.access import password_links, welcome
from robots.access.models import Course, PasswordLink
from robots.access.selectors import courses_managed_by

MOST = 200  # on a sheet: each has a picture


class Slip(Struct, frozen=True):
    """A person's link on a sheet."""

    person: User
    origin: str
    path: str  # of the link, behind the origin
    picture: SafeString


@never_cache
@require_POST
def course_links(request: HttpRequest, slug: str) -> HttpResponse:
    """Show the links of the people of a course who have no password yet: of those chosen, else of all."""
    course: Course = get_object_or_404(courses_managed_by(person_of(request)), slug=slug)
    people = User.objects.filter(enrolments__course=course, is_active=True)
    if chosen := request.POST.getlist("person"):
        people = people.filter(pk__in=[key for key in chosen if _is_key(key)])
    else:  # who signs in without a password, such as by single sign-on, needs none
        people = people.filter(last_login=None)
    waiting = [one for one in people.order_by("full_name", "username") if not one.has_usable_password()]
    if not waiting:
        messages.info(request, _("All of them have a password. Staff can show a link for a forgotten one."))
        return redirect("course", slug=slug)
    return _sheet(request, waiting, course)


@never_cache
@require_POST
def person_link(request: HttpRequest, person_id: UUID) -> HttpResponse:
    """Show the link of one person."""
    person = get_object_or_404(User, pk=person_id)
    if not password_links.may_see(person_of(request), [person]):
        raise Http404
    return _sheet(request, [person], None)


def _sheet(request: HttpRequest, people: Sequence[User], course: Course | None) -> HttpResponse:
    actor = person_of(request)
    allowed = password_links.may_see(actor, people)
    shown = [one for one in people if one.pk in allowed][:MOST]
    codes = password_links.shown(shown, actor=actor, anew="anew" in request.POST) if shown else {}
    first = PasswordLink.objects.filter(person__in=shown).first()
    context = {
        "course": course,
        "slips": [_slip(request, one, codes[one.pk]) for one in shown],
        "others": [one for one in people if one.pk not in allowed],
        "more": len(allowed) - len(shown),
        "last_moment": first and first.last_moment,
    }
    return render(request, "access/links.html", context)


def _slip(request: HttpRequest, person: User, code: str) -> Slip:
    path = welcome.path_of(code)
    link = public_url(request, path)
    picture = segno.make(link, error="m", micro=False).svg_inline(light="white", border=3, omitsize=True)
    return Slip(person, link.removesuffix(path), path, mark_safe(picture))  # noqa: S308 - only squares


def _is_key(text: str) -> bool:
    try:
        UUID(text)
    except ValueError:
        return False
    return True
