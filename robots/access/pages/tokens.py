"""The pages of a person's tokens; for staff also the pages of service accounts and their tokens.

They are in this folder and not in `fleet.accounts`, because a token can be limited to some robots. Their addresses are
not under /accounts/, because staff can open pages there before they have the second factor that the console demands.
"""

from __future__ import annotations

from datetime import timedelta
from uuid import UUID

from allauth.account.decorators import reauthentication_required
from django.contrib import messages
from django.db.models import Count, Max
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST, require_safe
from msgspec import Struct

from fleet.accounts.models import User
from fleet.accounts.requests import person_of, staff_of
from fleet.accounts.services import service_account_make
from fleet.accounts.tokens.models import Scope, Token
from fleet.accounts.tokens.services import (
    MOST,
    TokenExists,
    TooManyTokens,
    token_end,
    token_make,
    tokens_of,
)
from robots.access.pages.forms import ServiceAccountForm, TokenForm
from robots.access.selectors import robots_visible_to

_STAFF_ONLY = "Only staff manage service accounts."


class Shown(Struct, frozen=True):
    """A token in a list. `others`: the number of its robots that the token's person may not see."""

    token: Token
    scopes: list[str]
    robots: list[str]
    others: int
    expired: bool


def shown_tokens(owner: User) -> list[Shown]:
    """Return a person's tokens for a list."""
    now, names = timezone.now(), {str(robot.pk): robot.name for robot in robots_visible_to(owner)}
    return [
        Shown(
            token,
            [str(scope.label) for scope in Scope if token.opens(scope)],
            [names[key] for key in token.robots if key in names],
            sum(key not in names for key in token.robots),
            token.expires_at <= now,
        )
        for token in tokens_of(owner)
    ]


@never_cache
@require_safe
def my_tokens(request: HttpRequest) -> HttpResponse:
    """List the tokens of the person who is signed in."""
    person = person_of(request)
    return render(request, "access/tokens/tokens.html", {"tokens": shown_tokens(person), "person": person})


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
@reauthentication_required  # type: ignore[untyped-decorator]  # of django-allauth
def token_new(request: HttpRequest) -> HttpResponse:
    """Make a token of the person who is signed in."""
    return _new(request, person_of(request))


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
@reauthentication_required  # type: ignore[untyped-decorator]  # of django-allauth
def service_token_new(request: HttpRequest, person_id: UUID) -> HttpResponse:
    """Make a token of a service account. Nobody can make a token of another person."""
    staff_of(request, _STAFF_ONLY)
    return _new(request, get_object_or_404(User.objects.exclude(project=""), pk=person_id, is_active=True))


@never_cache
@require_POST
def token_remove(request: HttpRequest, token_id: UUID) -> HttpResponse:
    """End a token: a person their own, staff any. The password is not asked again: ending is urgent and safe."""
    actor = person_of(request)
    found = Token.objects.select_related("user").filter(pk=token_id).first()
    if found is None:  # somebody else has ended it
        messages.success(request, _("That token had ended already."))
        return redirect("tokens")
    if found.user != actor and not actor.is_staff:
        raise Http404
    token_end(token=found, actor=actor)
    messages.success(request, _("The token “%s” is ended.") % found.name)
    return redirect("tokens") if found.user == actor else redirect("person", found.user_id)


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def service_accounts(request: HttpRequest) -> HttpResponse:
    """List service accounts by project, and make a new one."""
    staff = staff_of(request, _STAFF_ONLY)
    form = ServiceAccountForm(request.POST if request.method == "POST" else None)
    if form.is_valid():
        made = service_account_make(actor=staff, **form.cleaned_data)
        messages.success(request, _("The service account %s is made. It needs a role and a token.") % made)
        return redirect("person", made.pk)
    found = User.objects.exclude(project="").annotate(count=Count("tokens"), used=Max("tokens__used_at"))
    context = {"accounts": found.order_by("project", "full_name"), "form": form}
    return render(request, "access/tokens/service_accounts.html", context, status=400 if form.errors else 200)


def _new(request: HttpRequest, owner: User) -> HttpResponse:
    posted = request.POST if request.method == "POST" else None
    form = TokenForm(posted, robots=robots_visible_to(owner), taken=tokens_of(owner))
    context = {"form": form, "person": owner, "own": owner == request.user}
    if not form.is_valid():
        return render(request, "access/tokens/token_new.html", context, status=400 if form.errors else 200)
    values = form.cleaned_data
    try:
        made, text = token_make(
            user=owner,
            name=values["name"],
            scopes=[Scope(name) for name in values["scopes"]],
            expires_at=timezone.now() + timedelta(days=values["days"]),
            robots=[robot.pk for robot in values["robots"]],
            actor=person_of(request),
            token_id=values["once"],
        )
    except TokenExists:
        messages.error(
            request, _("The token is made already, and its text is not shown again. Make another one.")
        )
        return redirect("tokens") if owner == request.user else redirect("person", owner.pk)
    except TooManyTokens:
        form.add_error(None, _("There are %d tokens, and more are not allowed: end one first.") % MOST)
        return render(request, "access/tokens/token_new.html", context, status=400)
    return render(request, "access/tokens/token_made.html", {**context, "token": made, "text": text})
