"""Signing in, and the list of one's own sign-ins."""

from __future__ import annotations

from uuid import UUID

from django.contrib import messages
from django.contrib.auth.views import LoginView
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_GET, require_POST

from fleet.accounts import services
from fleet.accounts.models import User
from fleet.accounts.selectors import sign_ins_of


class SignInView(LoginView):
    """The one door for people: pages and admin alike."""

    template_name = "accounts/sign_in.html"
    redirect_authenticated_user = False


@never_cache
@require_GET
def sessions(request: HttpRequest) -> HttpResponse:
    """Where the person is signed in."""
    user = _person(request)
    context = {"sign_ins": sign_ins_of(user.pk), "current": request.session.session_key}
    return render(request, "accounts/sessions.html", context)


@require_POST
def session_end(request: HttpRequest, sign_in_id: UUID) -> HttpResponse:
    """End one sign-in; what it holds open ends within a second."""
    ended = services.sign_in_end(user=_person(request), sign_in_id=sign_in_id)
    messages.success(request, "That session has ended." if ended else "That session had ended already.")
    return redirect("sessions")


@require_POST
def sessions_end_others(request: HttpRequest) -> HttpResponse:
    """End every sign-in but this one."""
    count = services.sign_ins_end_others(user=_person(request), session_key=request.session.session_key or "")
    messages.success(
        request, "There was no other session." if count == 0 else f"{count} other sessions have ended."
    )
    return redirect("sessions")


def _person(request: HttpRequest) -> User:
    """The signed-in person; LoginRequiredMiddleware has let nobody else through."""
    assert isinstance(request.user, User)
    return request.user
