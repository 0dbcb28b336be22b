"""Sign-in, change of password, and a person's list of sign-ins."""

from __future__ import annotations

from math import ceil
from uuid import UUID

from django.contrib import messages
from django.contrib.auth import update_session_auth_hash
from django.contrib.auth.forms import AuthenticationForm, PasswordChangeForm
from django.contrib.auth.views import LoginView, PasswordChangeView
from django.core.exceptions import NON_FIELD_ERRORS
from django.db import transaction
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.urls import reverse_lazy
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import ngettext
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from fleet.accounts import services
from fleet.accounts.forms import THROTTLED, SettingsForm, SignInForm
from fleet.accounts.requests import person_of
from fleet.accounts.selectors import sign_ins_of


class SignInView(LoginView):
    """The one door for people: pages and admin alike."""

    template_name = "accounts/sign_in.html"
    authentication_form = SignInForm

    def form_valid(self, form: AuthenticationForm) -> HttpResponse:
        """Sign in. Refused if it cannot be recorded."""
        with transaction.atomic():
            return super().form_valid(form)

    def form_invalid(self, form: AuthenticationForm) -> HttpResponse:
        """Show the form again; 429 while the name must wait, 503 while many others are being signed in."""
        response = super().form_invalid(form)
        if isinstance(form, SignInForm) and form.wait_s:
            response.status_code = 429 if form.has_error(NON_FIELD_ERRORS, THROTTLED) else 503
            response.headers["Retry-After"] = str(ceil(form.wait_s))
        return response


class PasswordView(PasswordChangeView):
    """One's own password."""

    template_name = "accounts/password.html"
    success_url = reverse_lazy("sessions")

    def form_valid(self, form: PasswordChangeForm) -> HttpResponse:
        """Change the password. Refused if it cannot be recorded.

        It is hashed first: that waits its turn, and within a transaction SQLite would keep everybody else from writing.
        """
        form.user.changed_by = person_of(self.request)
        form.user.set_password(form.cleaned_data["new_password1"])
        with transaction.atomic():
            form.user.save()
            update_session_auth_hash(self.request, form.user)
            services.own_password_changed(self.request, person_of(self.request))
        notice = _("Your password is changed. Every other browser has to sign in again.")
        messages.success(self.request, notice)
        return redirect(self.get_success_url())


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def own_settings(request: HttpRequest) -> HttpResponse:
    """Show and change what a person chooses for themselves."""
    person = person_of(request)
    chosen = {"time_zone": person.time_zone}
    form = SettingsForm(request.POST if request.method == "POST" else None, initial=chosen)
    if form.is_valid():
        services.time_zone_choose(user=person, name=form.cleaned_data["time_zone"])
        messages.success(request, _("Your settings are saved."))
        return redirect("your-settings")
    return render(request, "accounts/settings.html", {"form": form, "now": timezone.now()})


@never_cache
@require_safe
def sessions(request: HttpRequest) -> HttpResponse:
    """Where the person is signed in: `sign_ins`, of which `current` is the session key of this one."""
    context = {"sign_ins": sign_ins_of(person_of(request).pk), "current": request.session.session_key}
    return render(request, "accounts/sessions.html", context)


@require_POST
def session_end(request: HttpRequest, sign_in_id: UUID) -> HttpResponse:
    """End one sign-in; its connections end within a second."""
    ended = services.sign_in_end(user=person_of(request), sign_in_id=sign_in_id)
    if not request.session.exists(request.session.session_key or ""):  # this one: it keeps no message
        return redirect("sign-in")
    notice = _("That session has ended.") if ended else _("That session had ended already.")
    messages.success(request, notice)
    return redirect("sessions")


@require_POST
def sessions_end_others(request: HttpRequest) -> HttpResponse:
    """End every sign-in but this one."""
    count = services.sign_ins_end_others(
        user=person_of(request), session_key=request.session.session_key or ""
    )
    ended = ngettext("%(count)d other session ended.", "%(count)d other sessions ended.", count)
    notice = ended % {"count": count} if count else _("There was no other session.")
    messages.success(request, notice)
    return redirect("sessions")
