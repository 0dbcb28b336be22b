"""The first-run pages: make the first admin, add the first robot, and show how other people get access."""

from __future__ import annotations

from typing import cast

from django import forms
from django.conf import settings
from django.contrib.auth import login
from django.contrib.auth.decorators import login_not_required
from django.contrib.auth.forms import BaseUserCreationForm
from django.core.exceptions import ValidationError
from django.db import DatabaseError
from django.forms import modelform_factory
from django.http import HttpRequest, HttpResponse, HttpResponseBase
from django.shortcuts import redirect, render
from django.urls import path
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_safe

from fleet.accounts.models import User
from fleet.accounts.requests import GetResponse, staff_of
from fleet.accounts.sign_in import first_run, throttle
from fleet.site.reached_fields import FIRST, ReachedFields, ros_of
from robots.check.results import FAIL
from robots.check.robot_check import run_checks
from robots.registry import services
from robots.registry.models import Robot
from robots.registry.selectors import free_slug

_OPEN = (
    "/setup/",
    "/texts.js",
    "/healthz",
    "/readyz",
    "/livez",
    "/metrics",
    "/cookies/",
    "/privacy/",
    "/static/",
)
_STAFF_ONLY = "These pages are for staff."


class AdminForm(BaseUserCreationForm):  # type: ignore[type-arg]  # not subscriptable at run time
    """The first account."""

    code = forms.CharField(label=gettext_lazy("One-time code"), max_length=40)

    class Meta:
        model = User
        fields = ("username", "full_name", "email")


class RobotForm(ReachedFields, forms.ModelForm):  # type: ignore[type-arg]  # not subscriptable at run time
    """A new robot: its name, its profile, and how it is reached."""

    class Meta:
        model = Robot
        fields = ("name", "profile")


def leads_to_setup(get_response: GetResponse) -> GetResponse:
    """Middleware: while nobody has an account, redirect every page to the first-run page."""

    def middleware(request: HttpRequest) -> HttpResponseBase:
        if request.method == "GET" and not request.path.startswith(_OPEN) and _is_waiting():
            return redirect("setup")
        return get_response(request)

    return middleware


def _is_waiting() -> bool:
    try:
        return first_run.is_waiting()
    except DatabaseError:  # the page itself reports the error
        return False


@login_not_required
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def first_admin(request: HttpRequest) -> HttpResponse:
    """Make the first admin and sign the admin in. Refused once there is an account."""
    if not first_run.is_waiting():
        return render(request, "setup/closed.html", {"nobody": not User.objects.exists()}, status=403)
    form = AdminForm(request.POST or None)
    status = 200
    if form.is_valid():
        status = _made(request, form)
        if status == 302:
            return redirect("setup-robot")
    return render(request, "setup/admin.html", {"form": form}, status=status)


def _made(request: HttpRequest, form: AdminForm) -> int:
    """Make the account and sign in. Return the HTTP status: 302, or an error whose reason is in the form."""
    try:
        user = cast(User, form.save(commit=False))  # the password is hashed before the transaction
        refusal = first_run.admin_make(request, user, form.cleaned_data["code"])
    except throttle.TooMany:
        form.add_error("code", _("Too many wrong codes from this address. Try again in five minutes."))
        return 429
    if refusal:
        form.add_error("code", refusal)
        return 403
    login(request, user, backend=settings.AUTHENTICATION_BACKENDS[0])
    return 302


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def first_robot(request: HttpRequest) -> HttpResponse:
    """Add a robot, then check it."""
    person = staff_of(request, _STAFF_ONLY)
    ros = ros_of(request, None)
    form = modelform_factory(Robot, RobotForm, fields=["name", "profile", *FIRST[ros]])(request.POST or None)
    if form.is_valid():
        robot = form.save(commit=False)
        robot.slug = free_slug(Robot, robot.name)
        try:
            services.robot_save(robot=robot, actor=person)
        except ValidationError as error:
            form.add_error(None, error.messages)
        else:
            return redirect("setup-check", robot.slug)
    return render(request, "setup/robot.html", {"form": form, "robots": Robot.objects.all()})


@never_cache
@require_safe
def check(request: HttpRequest, slug: str) -> HttpResponse:
    """Show the problems that prevent driving the new robot, with remedies."""
    staff_of(request, _STAFF_ONLY)
    robot = Robot.objects.filter(slug=slug).first()
    if robot is None:
        return redirect("setup-robot")
    answers = run_checks(robot)
    failures = sum(answer.level == FAIL for answer in answers)
    return render(request, "setup/check.html", {"robot": robot, "answers": answers, "failures": failures})


@never_cache
@require_safe
def people(request: HttpRequest) -> HttpResponse:
    """Show the ways to give other people access."""
    staff_of(request, _STAFF_ONLY)
    return render(request, "setup/people.html")


urlpatterns = [
    path("", first_admin, name="setup"),
    path("robot/", first_robot, name="setup-robot"),
    path("robot/<slug:slug>/", check, name="setup-check"),
    path("people/", people, name="setup-people"),
]
