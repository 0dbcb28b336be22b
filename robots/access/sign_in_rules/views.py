"""The page of sign-in rules, for staff."""

from __future__ import annotations

from django import forms
from django.contrib import messages
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods

from fleet.accounts.requests import staff_of
from robots.access.models import Course, SignInRule
from robots.access.sign_in_rules.rules import rule_make, rule_remove


class RuleForm(forms.ModelForm):  # type: ignore[type-arg]
    """A new rule."""

    class Meta:
        model = SignInRule
        fields = ["claim", "value", "course", "group", "role"]

    def __init__(self, *arguments: object, **options: object) -> None:
        super().__init__(*arguments, **options)  # type: ignore[arg-type]
        self.fields["course"].queryset = Course.objects.filter(archived=False)  # type: ignore[attr-defined]


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def sign_in_rules(request: HttpRequest) -> HttpResponse:
    """Show the rules; make one, or remove one."""
    staff = staff_of(request, "Only staff change sign-in rules.")
    if removed := request.POST.get("remove"):
        rule_remove(get_object_or_404(SignInRule, pk=removed if removed.isdecimal() else 0), staff)
        messages.success(request, _("The rule is removed. What it gave stays until somebody takes it away."))
        return redirect("sign-in-rules")
    form = RuleForm(request.POST or None)
    if form.is_valid():
        rule_make(form.instance, staff)
        messages.success(request, _("The rule is made. It acts at each person’s next single sign-on."))
        return redirect("sign-in-rules")
    rules = SignInRule.objects.select_related("course", "group")
    status = 400 if form.errors else 200
    return render(request, "access/sign_in_rules.html", {"rules": rules, "form": form}, status=status)
