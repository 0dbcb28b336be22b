"""Sign in by password, and change one's own password."""

from __future__ import annotations

import logging
from collections.abc import Callable
from math import ceil
from typing import Any, cast

from allauth.account.internal.flows.login import record_authentication
from allauth.account.utils import perform_login
from allauth.account.views import PasswordResetFromKeyView
from allauth.socialaccount.providers.openid_connect import views as openid_connect
from django.conf import settings
from django.contrib import messages
from django.contrib.auth import update_session_auth_hash
from django.contrib.auth.decorators import login_not_required
from django.contrib.auth.forms import AuthenticationForm, PasswordChangeForm
from django.contrib.auth.views import LoginView, PasswordChangeView
from django.core.exceptions import NON_FIELD_ERRORS
from django.db import transaction
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.urls import reverse, reverse_lazy
from django.utils.translation import gettext as _
from django.utils.translation import ngettext
from requests import RequestException

from fleet.accounts import services
from fleet.accounts.models import User
from fleet.accounts.requests import person_of
from fleet.accounts.sign_in import known_device
from fleet.accounts.sign_in.forms import THROTTLED, NewPasswordForm, OwnPasswordForm, SignInForm

log = logging.getLogger(__name__)


class SignInView(LoginView):
    """The only sign-in page for people, also for the admin."""

    template_name = "accounts/sign_in.html"
    authentication_form = SignInForm

    def form_valid(self, form: AuthenticationForm) -> HttpResponse:
        """Sign in, or ask for the second factor. A sign-in that cannot be recorded is refused."""
        user = form.get_user()
        record_authentication(self.request, user, method="password")
        with transaction.atomic():
            answer = cast(
                HttpResponse, perform_login(self.request, user, redirect_url=self.get_redirect_url())
            )
        if self.request.POST.get("own_device") and not user.is_staff:
            known_device.remember(answer, user)
        return answer

    def get_context_data(self, **context: Any) -> dict[str, Any]:
        """Add the other ways to sign in."""
        return super().get_context_data(single_sign_on=single_sign_on_name(), **context)

    def form_invalid(self, form: AuthenticationForm) -> HttpResponse:
        """Show the form again, with 429 while the name must wait, and 503 while too many people sign in."""
        response = super().form_invalid(form)
        if isinstance(form, SignInForm) and form.wait_s:
            response.status_code = 429 if form.has_error(NON_FIELD_ERRORS, THROTTLED) else 503
            response.headers["Retry-After"] = str(ceil(form.wait_s))
        return response


def sign_in_now(request: HttpRequest, person: User, method: str) -> HttpResponse:
    """Sign in a person who need not type a password now; a second factor is asked for.

    Somebody else who is signed in in this browser stays so.
    """
    if isinstance(request.user, User) and request.user != person:
        return redirect("fleet")
    record_authentication(request, person, method=method)
    with transaction.atomic():
        answer: HttpResponse = perform_login(request, person, redirect_url=reverse("fleet"))
    return answer


class NewPasswordView(PasswordResetFromKeyView):
    """Set a new password by the link of an e-mail, and sign in."""

    form_class = NewPasswordForm

    def form_valid(self, form: NewPasswordForm) -> HttpResponse:
        """Set the password before the transaction of the sign-in: hashing waits in a queue."""
        super().form_valid(form)
        return sign_in_now(self.request, self.reset_user, "password")


class PasswordView(PasswordChangeView):
    """Change one's own password."""

    template_name = "accounts/password.html"
    form_class = OwnPasswordForm
    success_url = reverse_lazy("your-account")

    def get_form_kwargs(self) -> dict[str, Any]:
        """Give the form the address of the request."""
        return {**super().get_form_kwargs(), "address": services.address_of(self.request)}

    def form_valid(self, form: PasswordChangeForm) -> HttpResponse:
        """Change the password, and end the tokens if the person chose that. Refused if it cannot be recorded.

        The password is hashed before the transaction: hashing waits in a queue, and SQLite allows one writer
        at a time.
        """
        form.user.changed_by = person_of(self.request)
        form.user.set_password(form.cleaned_data["new_password1"])
        with transaction.atomic():
            form.user.save()
            update_session_auth_hash(self.request, form.user)
            services.own_password_changed(self.request, person_of(self.request))
            ended = cast(OwnPasswordForm, form).end_chosen_tokens()
        notice = _("Your password is changed. Every other browser has to sign in again.")
        tokens = ngettext("%d token is ended.", "%d tokens are ended.", ended) % ended
        messages.success(self.request, f"{notice} {tokens}" if ended else notice)
        return redirect(self.get_success_url())


def _provider_may_be_away(view: Callable[..., HttpResponse]) -> Callable[..., HttpResponse]:
    """Show an error page (502) if the provider does not answer, or sends an invalid answer."""

    def guarded(request: HttpRequest, provider_id: str) -> HttpResponse:
        try:
            return view(request, provider_id)
        except (RequestException, KeyError) as error:
            log.warning("Single sign-on: the provider did not answer as it should: %r", error)
            return render(request, "socialaccount/authentication_error.html", status=502)

    return login_not_required(guarded)


single_sign_on_begin = _provider_may_be_away(openid_connect.login)
single_sign_on_end = _provider_may_be_away(openid_connect.callback)


def single_sign_on_name() -> str:
    """Return the name of the single sign-on provider; blank if there is none."""
    for provider in settings.SOCIALACCOUNT_PROVIDERS.values():
        return str(provider["APPS"][0]["name"])
    return ""
