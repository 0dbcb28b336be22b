"""Pages for many people at once, for staff: export what the console knows about them, and erase them for good."""

from __future__ import annotations

from uuid import UUID

from django.contrib import messages
from django.http import HttpRequest, HttpResponse, HttpResponseBase
from django.shortcuts import redirect, render
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import ngettext
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_POST

from fleet.accounts.erasing import erasable, erasures_ask
from fleet.accounts.models import User
from fleet.accounts.requests import staff_of
from fleet.base.web.time_takers import may_take_time
from fleet.bookings.losses.collecting import collected
from robots.access.models import Course
from teleop.reports.own_data import export_of_many

_STAFF_ONLY = "Only staff export and erase people."
MOST = 1000


@never_cache
@require_POST
def people_export(request: HttpRequest) -> HttpResponseBase:
    """Return the data of the chosen people as JSON Lines. The export is recorded."""
    staff = staff_of(request, _STAFF_ONLY)
    people = _chosen(request)
    return export_of_many(people, actor=staff) if people else _nobody(request)


@never_cache
@require_POST
@may_take_time
def people_erase(request: HttpRequest) -> HttpResponseBase:
    """Ask whether the chosen people are to be erased; then close their accounts at once."""
    staff = staff_of(request, _STAFF_ONLY)
    people = erasable(_chosen(request), staff)
    if not people:
        return _nobody(request)
    if "sure" not in request.POST:
        return ask_to_erase(request, people)
    count = erasures_ask(people=people, actor=staff, now=timezone.now())
    if (losses := collected()) is not None:
        losses.for_good = True
    text = ngettext(
        "%(n)d account is closed; its person is erased within minutes.",
        "%(n)d accounts are closed; their people are erased within minutes.",
        count,
    )
    messages.success(request, text % {"n": count})
    return redirect(_list_of(request))


def ask_to_erase(request: HttpRequest, people: list[User]) -> HttpResponse:
    """Show whom the form erases."""
    context = {"people": people, "course": request.POST.get("course", ""), "back": _list_of(request)}
    return render(request, "site/people_erase.html", context)


def _chosen(request: HttpRequest) -> list[User]:
    """Return the people of the request: those ticked, or everybody in a course."""
    people = User.objects.filter(project="")
    if request.POST.get("everybody") and (course := request.POST.get("course")):
        return list(people.filter(enrolments__course__slug=course.replace("\0", ""))[:MOST])
    keys = request.POST.getlist("person")
    return list(people.filter(pk__in=[key for key in keys if _is_key(key)][:MOST]))


def _nobody(request: HttpRequest) -> HttpResponse:
    messages.error(request, _("Choose people first."))
    return redirect(_list_of(request))


def _list_of(request: HttpRequest) -> str:
    """Return the page on which the people were chosen: a course's, or the list of all accounts."""
    slug = request.POST.get("course", "").replace("\0", "")
    if Course.objects.filter(slug=slug).exists():
        return reverse("course", args=[slug])
    return reverse("admin:accounts_user_changelist")


def _is_key(text: str) -> bool:
    try:
        UUID(text)
    except ValueError:
        return False
    return True
