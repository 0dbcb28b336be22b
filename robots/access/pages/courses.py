"""The pages of courses, for their supervisors and staff."""

from __future__ import annotations

import io
from typing import Any
from uuid import UUID

import segno
from django.contrib import messages
from django.contrib.auth.hashers import UNUSABLE_PASSWORD_PREFIX
from django.core.exceptions import PermissionDenied
from django.db.models import Count, Q
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import ngettext
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from fleet.accounts.mail.off import is_off
from fleet.accounts.requests import person_of, staff_of
from fleet.base.formats.sentences import localised
from fleet.base.web.origin import public_origin, public_url
from fleet.base.web.paging import list_address, page_of
from fleet.base.web.time_takers import may_take_time
from robots.access import enrolment, services, welcome
from robots.access.models import Course, Invitation
from robots.access.pages.forms import (
    ActionForm,
    CourseForm,
    EnrolForm,
    InvitationForm,
    PeopleForm,
    digest,
    end_of,
)
from robots.access.pages.list_preview import preview
from robots.access.selectors import (
    courses_managed_by,
    demanded_in,
    grants_in,
    lab_date,
    robots_of,
)

SEARCHED = ("person__full_name", "person__username", "person__email", "number")
_WAITING = Q(  # for a first password
    person__is_active=True, person__last_login=None, person__password__startswith=UNUSABLE_PASSWORD_PREFIX
)
_STAFF_ONLY = "Only staff make and change courses."


@never_cache
@require_safe
def courses(request: HttpRequest) -> HttpResponse:
    """List the courses that this person manages."""
    found = _managed(request).annotate(people=Count("enrolments")).prefetch_related("supervisors")
    if not found and not person_of(request).is_staff:
        raise PermissionDenied("Courses are managed by their supervisors and staff.")
    today = lab_date()
    context = {
        "current": [one for one in found if not one.archived and one.ends_on >= today],
        "past": [one for one in found if one.archived or one.ends_on < today],
        "today": today,
    }
    return render(request, "access/courses/courses.html", context)


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def course_new(request: HttpRequest) -> HttpResponse:
    """Make a course with its people: show a form, then a preview of the list, then save."""
    staff = staff_of(request, _STAFF_ONLY)
    if request.method != "POST":
        return _course_form(request, CourseForm())
    form = CourseForm(request.POST, request.FILES)
    if not form.is_valid() or _must_preview(request, form):
        return _course_form(request, form)
    made = services.course_save(course=form.instance, actor=staff, **_lists(form))
    _enrol(request, made, form)
    return redirect("course", slug=made.slug)


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
@may_take_time
def course_edit(request: HttpRequest, slug: str) -> HttpResponse:
    """Change a course: robots, dates, quotas, supervisors. Staff only."""
    staff = staff_of(request, _STAFF_ONLY)
    course = get_object_or_404(Course, slug=slug)
    form = CourseForm(request.POST or None, instance=course)
    if request.method == "POST" and form.is_valid():
        services.course_save(course=form.instance, actor=staff, **_lists(form))
        messages.success(request, _("The course is saved."))
        return redirect("course", slug=slug)
    return _course_form(request, form)


@require_POST
@may_take_time
def course_archive(request: HttpRequest, slug: str) -> HttpResponse:
    """Archive a course, or open it again."""
    staff = staff_of(request, _STAFF_ONLY)
    course = get_object_or_404(Course, slug=slug)
    archived = request.POST.get("archived") == "1"
    services.course_archive(course=course, archived=archived, actor=staff)
    done = _("%s is archived: its people have lost their roles.") if archived else _("%s is open again.")
    messages.success(request, done % course.name)
    return redirect("course", slug=slug)


@never_cache
@require_safe
def course(request: HttpRequest, slug: str) -> HttpResponse:
    """Show a course: people, robots, dates, quotas, qualifications, invitations."""
    return _course_page(request, _one(request, slug))


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def course_enrol(request: HttpRequest, slug: str) -> HttpResponse:
    """Enrol people by a list, after a preview."""
    found = _one(request, slug)
    if request.method != "POST":
        return _enrol_page(request, found, EnrolForm())
    form = EnrolForm(request.POST, request.FILES)
    if not form.is_valid() or _must_preview(request, form):
        return _enrol_page(request, found, form)
    _enrol(request, found, form)
    return redirect("course", slug=slug)


@never_cache
@require_POST
@may_take_time
def course_people(request: HttpRequest, slug: str) -> HttpResponse:
    """Apply an action to chosen people: unenrol, grant or revoke a qualification, or send their e-mails again."""
    found = _one(request, slug)
    form = ActionForm(request.POST, course=found, qualifications=demanded_in(found))
    if not form.is_valid():
        for texts in form.errors.values():
            messages.error(request, str(texts[0]))
    else:
        messages.success(request, _do(request, found, form.cleaned_data))
    return redirect(list_address(request, "course", slug))


def _do(request: HttpRequest, course: Course, values: dict[str, Any]) -> str:
    """Do the action of the pressed button. Returns a sentence about the result."""
    actor, people, action = person_of(request), values["people"], request.POST.get("action")
    facts: dict[str, Any] = {"course": course.name, "qualification": values.get("qualification")}
    if action == "unenrol":
        count = enrolment.unenrol(course=course, people=people, actor=actor)
        text = ngettext("%(n)d person left %(course)s.", "%(n)d people left %(course)s.", count)
    elif action == "invite" and is_off():
        count, text = (
            0,
            _("No e-mail is sent: the console has no mail server. Show people their links instead."),
        )
    elif action == "invite":
        waiting = welcome.waiting_among(people)
        welcome.send_later(waiting, course=course, site=public_origin(request))
        count = len(waiting)
        text = ngettext("%(n)d e-mail is on its way.", "%(n)d e-mails are on their way.", count)
        if not count:
            text = _(
                "No e-mail is sent: all whom you chose have a password, no e-mail address, or a closed account."
            )
    elif action == "copy":
        target = get_object_or_404(_managed(request), slug=request.POST.get("to", ""))
        numbers = dict(course.enrolments.values_list("person_id", "number"))
        count = enrolment.enrol(course=target, people=people, actor=actor, numbers=numbers)
        facts["course"] = target.name
        text = ngettext("%(n)d person is also in %(course)s.", "%(n)d people are also in %(course)s.", count)
    elif facts["qualification"] is None:
        count, text = 0, _("The robots of this course demand no qualification.")
    elif action == "grant":
        until = end_of(values["until"])
        count = services.qualification_grant(
            qualification=facts["qualification"], people=people, expires_at=until, actor=actor
        )
        text = ngettext(
            "%(n)d person was granted: %(qualification)s.",
            "%(n)d people were granted: %(qualification)s.",
            count,
        )
    else:
        count = services.qualification_revoke(
            qualification=facts["qualification"], people=people, actor=actor
        )
        text = ngettext(
            "%(n)d person lost: %(qualification)s.", "%(n)d people lost: %(qualification)s.", count
        )
    return text % {"n": count, **facts} if "%(" in text else text


# --- invitations ----------------------------------------------------------------------------------


@require_POST
def invitation_new(request: HttpRequest, slug: str) -> HttpResponse:
    """Make an invitation, and redirect to its page."""
    found = _one(request, slug)
    form = InvitationForm(request.POST)
    if not form.is_valid():
        return _course_page(request, found, form, 400)
    made = enrolment.invitation_make(
        course=found,
        expires_at=end_of(form.cleaned_data["last_day"]) or timezone.now(),
        most_uses=form.cleaned_data["most_uses"],
        actor=person_of(request),
    )
    return redirect("invitation", slug=slug, invitation_id=made.pk)


@never_cache
@require_safe
def invitation(request: HttpRequest, slug: str, invitation_id: UUID) -> HttpResponse:
    """Show an invitation's link and QR code, large enough for a projector."""
    found = _invitation(request, slug, invitation_id)
    context = {
        "course": found.course,
        "invitation": found,
        "link": _join_link(request, found),
        "refusal": enrolment.check_invitation(found, timezone.now()),
    }
    return render(request, "access/joining/invitation.html", context)


@never_cache
@require_safe
def invitation_qr(request: HttpRequest, slug: str, invitation_id: UUID) -> HttpResponse:
    """Return the QR code of an invitation as a picture."""
    link = _join_link(request, _invitation(request, slug, invitation_id))
    picture = io.BytesIO()
    segno.make(link, error="m", micro=False).save(picture, kind="svg", scale=8, light="white", border=4)
    return HttpResponse(picture.getvalue(), content_type="image/svg+xml")


@require_POST
def invitation_revoke(request: HttpRequest, slug: str, invitation_id: UUID) -> HttpResponse:
    """End an invitation."""
    found = _invitation(request, slug, invitation_id)
    enrolment.invitation_revoke(invitation=found, actor=person_of(request))
    messages.success(request, _("The invitation is revoked: nobody can join by it any more."))
    return redirect("course", slug=slug)


def _invitation(request: HttpRequest, slug: str, invitation_id: UUID) -> Invitation:
    return get_object_or_404(
        Invitation.objects.select_related("course"), pk=invitation_id, course=_one(request, slug)
    )


def _join_link(request: HttpRequest, found: Invitation) -> str:
    return public_url(request, reverse("join", args=[found.code]))


# --- helpers --------------------------------------------------------------------------------------


def _managed(request: HttpRequest) -> Any:
    return courses_managed_by(person_of(request))


def _one(request: HttpRequest, slug: str) -> Course:
    found: Course = get_object_or_404(_managed(request), slug=slug)
    return found


def _lists(form: CourseForm) -> dict[str, Any]:
    return {name: list(form.cleaned_data[name]) for name in ("robots", "groups", "supervisors")}


def _must_preview(request: HttpRequest, form: PeopleForm) -> bool:
    """Return whether a preview of the list must be shown first: there was none, or the list was changed since."""
    if form.people_list.is_empty:
        return False
    asked = "again" in request.POST or form.encoding_fault
    return bool(asked) or request.POST.get("seen") != digest(form.people_list)


def _with_preview(request: HttpRequest, form: PeopleForm, course: Course | None) -> dict[str, Any]:
    """Return the templates' context for a form and its list, if one was sent: errors do not lose it."""
    if not form.is_bound:
        return {"form": form}
    form.repeat()
    if form.people_list.is_empty:
        return {"form": form}
    plan = enrolment.plan_of(form.people_list, course, person_of(request))
    return {"form": form, **preview(form, plan)}


def _enrol(request: HttpRequest, found: Course, form: PeopleForm) -> None:
    plan = enrolment.enrol_list(
        course=found, people=form.people_list, actor=person_of(request), site=public_origin(request)
    )
    facts = {
        "course": found.name,
        "people": plan.to_enrol,
        "new": len(plan.new),
        "numbers": len(plan.renumbered),
    }
    if plan.undisclosed and is_off():
        text = ngettext(
            "%(people)d person is enrolled in %(course)s; each person without an account got one.",
            "%(people)d people are enrolled in %(course)s; each person without an account got one.",
            plan.to_enrol,
        )
    elif plan.undisclosed:
        text = ngettext(
            "%(people)d person is enrolled in %(course)s; each person without an account got one, and an e-mail.",
            "%(people)d people are enrolled in %(course)s; each person without an account got one, and an e-mail.",
            plan.to_enrol,
        )
    elif plan.to_enrol:
        text = ngettext(
            "%(people)d person is enrolled in %(course)s; new accounts: %(new)d.",
            "%(people)d people are enrolled in %(course)s; new accounts: %(new)d.",
            plan.to_enrol,
        )
    elif plan.renumbered:
        text = ngettext(
            "%(numbers)d student number is stored in %(course)s.",
            "%(numbers)d student numbers are stored in %(course)s.",
            len(plan.renumbered),
        )
    elif form.people_list.people:
        text = _("All of them are in %(course)s already.")
    else:
        text = _("The course %(course)s is made.")
    messages.success(request, text % facts)


def _course_form(request: HttpRequest, form: CourseForm) -> HttpResponse:
    course = form.instance if form.instance.pk else None
    context = {"course": course, **_with_preview(request, form, course)}
    status = 400 if form.errors else 200
    return render(request, "access/courses/course_form.html", context, status=status)


def _enrol_page(request: HttpRequest, found: Course, form: EnrolForm) -> HttpResponse:
    context = {"course": found, **_with_preview(request, form, found)}
    status = 400 if form.errors else 200
    return render(request, "access/courses/enrol.html", context, status=status)


def _course_page(
    request: HttpRequest, found: Course, form: InvitationForm | None = None, status: int = 200
) -> HttpResponse:
    now = timezone.now()
    qualifications = demanded_in(found)
    enrolled = found.enrolments.select_related("person").order_by("person__full_name", "person__username")
    page = page_of(request, enrolled, *SEARCHED)
    besides = list(found.supervisors.exclude(enrolments__course=found)) if qualifications else []
    held = grants_in(found, now, [*(one.person_id for one in page), *(one.pk for one in besides)])
    context = {
        "course": found,
        "robots": robots_of(found),
        "page": page,
        "people": [
            {"person": one.person, "number": one.number, "held": held.get(one.person_id, ())} for one in page
        ],
        "supervisors": [{"person": one, "held": held.get(one.pk, ())} for one in besides],
        **enrolled.aggregate(
            enrolled=Count("pk"),
            waiting=Count("pk", filter=_WAITING),
            refused=Count("pk", filter=Q(person__email_refused_at__isnull=False)),
        ),
        "qualifications": qualifications,
        "others": _managed(request).filter(archived=False).exclude(pk=found.pk),
        "action": ActionForm(course=found, qualifications=qualifications),
        "invitations": [
            one for one in found.invitations.all() if enrolment.check_invitation(one, now) is None
        ],
        "invite": form or InvitationForm(),
        "valid": not found.archived and found.starts_on <= lab_date() <= found.ends_on,
        "quotas": _quotas(found),
    }
    return render(request, "access/courses/course.html", context, status=status)


def _quotas(found: Course) -> list[str]:
    def hours(minutes: int) -> str:
        return localised(minutes / 60)

    texts = []
    if found.day_min:
        texts.append(_("%s h per person and day") % hours(found.day_min))
    if found.week_min:
        texts.append(_("%s h per person and week") % hours(found.week_min))
    if found.at_once:
        texts.append(_("%d bookings to come per person") % found.at_once)
    if found.course_week_min:
        texts.append(_("%s h per week for the whole course") % hours(found.course_week_min))
    return texts
