"""A person's own pages: account, settings, list of sign-ins."""

from __future__ import annotations

from uuid import UUID

from allauth.account.models import EmailAddress
from allauth.socialaccount.models import SocialAccount
from django.contrib import messages
from django.core.exceptions import ValidationError
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import ngettext
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from fleet.accounts import services
from fleet.accounts.pages.forms import PageChoicesForm, SettingsForm
from fleet.accounts.requests import person_of
from fleet.accounts.selectors import sign_ins_of
from fleet.accounts.sign_in import second_factor
from fleet.accounts.sign_in.views import single_sign_on_name
from fleet.accounts.tokens.services import tokens_of


@never_cache
@require_safe
def account(request: HttpRequest) -> HttpResponse:
    """Show how a person signs in, with links to change it."""
    person = person_of(request)
    addresses = EmailAddress.objects.filter(user=person)
    context = {
        "verified": addresses.filter(email=person.email, verified=True).exists(),
        "pending": addresses.exclude(email=person.email).values_list("email", flat=True).first(),
        "second_factor": second_factor.has_second_factor(person),
        "second_factor_missing": second_factor.is_missing(person),
        "single_sign_on": single_sign_on_name(),
        "connected": SocialAccount.objects.filter(user=person).exists(),
        "tokens": tokens_of(person).count(),
        "sign_ins": sign_ins_of(person.pk).count(),
        "now": timezone.now(),
    }
    return render(request, "accounts/account.html", context)


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def own_settings(request: HttpRequest) -> HttpResponse:
    """Show and change the person's own settings."""
    person = person_of(request)
    chosen = {"time_zone": person.time_zone, "language": person.language}
    form = SettingsForm(request.POST if request.method == "POST" else None, initial=chosen)
    if form.is_valid():
        services.settings_choose(user=person, **form.cleaned_data)
        messages.success(request, _("Your settings are saved."))
        return redirect("your-settings")
    return render(request, "accounts/settings.html", {"form": form, "now": timezone.now()})


@require_POST
def page_choices(request: HttpRequest) -> HttpResponse:
    """Store choices that a page sends for its person: 204, or 400 with the reason, and nothing is stored."""
    form = PageChoicesForm(request.POST)
    try:
        if not form.is_valid():
            raise ValidationError([text for errors in form.errors.as_data().values() for text in errors])
        services.page_choices_keep(user=person_of(request), kept=form.kept)
    except ValidationError as error:
        text = " ".join(error.messages)
        return JsonResponse({"code": "bad_choice", "text": text, "rule": "account"}, status=400)
    return HttpResponse(status=204)


@never_cache
@require_safe
def sessions(request: HttpRequest) -> HttpResponse:
    """List the person's sign-ins (`sign_ins`). `current` is the session key of this browser."""
    context = {"sign_ins": sign_ins_of(person_of(request).pk), "current": request.session.session_key}
    return render(request, "accounts/sessions.html", context)


@require_POST
def session_end(request: HttpRequest, sign_in_id: UUID) -> HttpResponse:
    """End one sign-in; its connections end within a second."""
    ended = services.sign_in_end(user=person_of(request), sign_in_id=sign_in_id)
    if not request.session.exists(request.session.session_key or ""):  # this session: it stores no message
        return redirect("sign-in")
    notice = _("That session has ended.") if ended else _("That session had ended already.")
    messages.success(request, notice)
    return redirect("sessions")


@require_POST
def sessions_end_others(request: HttpRequest) -> HttpResponse:
    """End every sign-in except that of this browser."""
    count = services.sign_ins_end_others(
        user=person_of(request), session_key=request.session.session_key or ""
    )
    ended = ngettext("%(count)d other session ended.", "%(count)d other sessions ended.", count)
    notice = ended % {"count": count} if count else _("There was no other session.")
    messages.success(request, notice)
    return redirect("sessions")
