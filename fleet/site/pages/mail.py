"""The page of the mail server, for staff: what is set, and a test."""

from __future__ import annotations

from django import forms
from django.conf import settings
from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils.translation import gettext_lazy as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods

from fleet.accounts.emails import why_none_leaves
from fleet.accounts.mail.off import is_off
from fleet.accounts.mail.trial import trial
from fleet.accounts.requests import staff_of
from fleet.base.web.origin import settled_origin


class TrialForm(forms.Form):
    to = forms.EmailField(label=_("E-mail address"), max_length=254)


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def mail(request: HttpRequest) -> HttpResponse:
    """Show the mail server; send a test e-mail and show what the server answered."""
    staff = staff_of(request, "Only staff test the mail server.")
    form = TrialForm(request.POST if request.method == "POST" else None, initial={"to": staff.email})
    context = {
        "form": form,
        "server": f"{settings.EMAIL_HOST}:{settings.EMAIL_PORT}",
        "sender": settings.DEFAULT_FROM_EMAIL,
        "origin": settled_origin(),
    }
    if form.is_valid() and not is_off():
        context |= {"to": form.cleaned_data["to"], "fault": trial(to=form.cleaned_data["to"], actor=staff)}
    context["why_none_leaves"] = why_none_leaves()  # after the test
    return render(request, "site/mail.html", context, status=400 if form.errors else 200)
