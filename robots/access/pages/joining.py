"""Pages for new people: join a course by an invitation, set the first password of an account made by others."""

from __future__ import annotations

from typing import Any

from django.contrib import messages
from django.contrib.auth.decorators import login_not_required
from django.contrib.auth.forms import SetPasswordForm
from django.db import transaction
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods

from fleet.accounts.models import User
from fleet.accounts.services import address_of
from fleet.accounts.sign_in import known_device, throttle
from fleet.accounts.sign_in.views import sign_in_now
from robots.access import password_links
from robots.access.claiming import claim, has_unclaimed
from robots.access.enrolment import EnrolmentRefused, check_invitation, invitation_accept, invitation_of
from robots.access.models import Invitation
from robots.access.pages.forms import JoinForm


@never_cache
@login_not_required
@require_http_methods(["GET", "HEAD", "POST"])
def join(request: HttpRequest, code: str) -> HttpResponse:
    """Join a course: with the account of the person who is signed in, one that the course's list made, or a new one."""
    invitation = invitation_of(code)
    refusal = check_invitation(invitation, timezone.now())
    if refusal is not None or invitation is None:
        return _join_page(request, invitation, refusal=refusal, status=410)
    signed_in = isinstance(request.user, User)
    known = None if signed_in else _known_in(request, invitation)
    if known is not None and "device" in request.POST:
        return sign_in_now(request, known, "known_device")
    if known is not None and request.method != "POST" and "new" not in request.GET:
        return _join_page(request, invitation, known=known)
    if not signed_in and "known_as" in request.POST:
        return _find(request, invitation)
    form = JoinForm(
        request.POST if request.method == "POST" and not signed_in else None, course=invitation.course
    )
    if request.method != "POST":
        listed = not signed_in and "new" not in request.GET and has_unclaimed(invitation.course)
        return _join_page(request, invitation, form, listed=listed)
    try:
        return _join(request, invitation, form)
    except EnrolmentRefused as error:
        return _join_page(request, invitation, refusal=error.refusal, status=410)


def _known_in(request: HttpRequest, invitation: Invitation) -> User | None:
    """Return the person of the course whose own device this is, if it is one."""
    person = known_device.known_person(request)
    inside = person is not None and invitation.course.enrolments.filter(person=person).exists()
    return person if inside else None


def _find(request: HttpRequest, invitation: Invitation) -> HttpResponse:
    """Lead a person of the course's list to the link by which they set their password."""
    try:
        code = claim(invitation=invitation, typed=request.POST["known_as"], address=address_of(request))
    except EnrolmentRefused as error:
        return _join_page(request, invitation, listed=True, found=error.refusal, status=409)
    except throttle.TooMany as error:
        return _join_page(request, invitation, listed=True, wait=throttle.words(error.wait_s), status=429)
    return redirect("welcome", code)


def _join(request: HttpRequest, invitation: Invitation, form: JoinForm) -> HttpResponse:
    now = timezone.now()
    if isinstance(request.user, User):
        invitation_accept(invitation=invitation, person=request.user, now=now)
        messages.success(request, _("You are in the course %s.") % invitation.course.name)
        return redirect("my-access")
    if not form.is_valid():
        return _join_page(request, invitation, form, status=400)
    # `form.save` hashes the password, which may have to wait; inside a transaction, other people would wait too.
    person: User = form.save(commit=False)
    person.changed_by = person
    with transaction.atomic():
        person.save()
        invitation_accept(invitation=invitation, person=person, now=now)
    messages.success(request, _("You are in the course %s.") % invitation.course.name)
    return sign_in_now(request, person, "password")


def _join_page(
    request: HttpRequest,
    invitation: Invitation | None,
    form: JoinForm | None = None,
    *,
    status: int = 200,
    **context: Any,
) -> HttpResponse:
    """Show the page. `listed`: ask first who of the course's list it is; `found`: why this leads to no account."""
    context |= {"course": invitation and invitation.course, "form": form}
    return render(request, "access/joining/join.html", context, status=status)


@never_cache
@login_not_required
@require_http_methods(["GET", "HEAD", "POST"])
def welcome(request: HttpRequest, code: str) -> HttpResponse:
    """Set the password of an account, by the person's link, and sign the person in."""
    link = password_links.link_of(code)
    if link is None:
        return render(request, "access/joining/welcome.html", status=410)
    person = link.person
    form = SetPasswordForm(person, request.POST or None)
    for field in form.fields.values():
        field.label = _("Password")  # of both fields: Django reports every fault at the second one
    if request.method != "POST" or not form.is_valid():
        return _welcome_page(request, form, 400 if form.errors else 200)
    person.set_password(form.cleaned_data["new_password1"])
    if not password_links.password_set(link, person):
        return render(request, "access/joining/welcome.html", status=410)
    messages.success(request, _("Your password is set. Your user name is %s.") % person.username)
    return sign_in_now(request, person, "password")


def _welcome_page(request: HttpRequest, form: SetPasswordForm[User], status: int) -> HttpResponse:
    context = {"form": form, "person": form.user}
    return render(request, "access/joining/welcome.html", context, status=status)
