"""*Add a bridge host*: one command with a code, with which another computer joins."""

from __future__ import annotations

from typing import Any

from django.contrib import admin, messages
from django.db.models import QuerySet
from django.forms import ModelForm
from django.http import HttpRequest, HttpResponse
from django.template.response import TemplateResponse
from django.urls import reverse
from django.utils.timezone import localtime, now
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from fleet.accounts.requests import person_of
from fleet.audit.recorded_admin import RecordedAdmin
from robots.registry import bridge_hosts
from robots.registry.models import BridgeHost


@admin.register(BridgeHost)
class BridgeHostAdmin(RecordedAdmin):
    """Computers that run bridges of robots near them."""

    list_display = ["name", "state", "certificate_until"]
    actions = ["make_command"]
    fields = ["name"]

    @admin.display(description=_("state"))
    def state(self, host: BridgeHost) -> str:
        """Return whether the computer has joined, or until when it may."""
        if host.code_until and host.code_until > now():
            return gettext("may join until %s") % f"{localtime(host.code_until):%H:%M}"
        if host.joined_at:
            return gettext("joined %s") % f"{localtime(host.joined_at):%Y-%m-%d %H:%M}"
        return gettext("its code is over: make a new command")

    def add_view(self, request: HttpRequest, form_url: str = "", extra_context: Any = None) -> HttpResponse:
        """Say why there is no form while no other computer can run bridges."""
        if reason := bridge_hosts.why_not():
            return self._page(request, {"reason": reason})
        only_save = dict.fromkeys(("show_save_and_add_another", "show_save_and_continue"), False)
        return super().add_view(request, form_url, {**(extra_context or {}), **only_save})

    def save_model(
        self, request: HttpRequest, obj: BridgeHost, form: ModelForm[BridgeHost], change: bool
    ) -> None:
        """Save nothing yet: `response_add` saves the host with its code."""

    def response_add(
        self, request: HttpRequest, obj: BridgeHost, post_url_continue: str | None = None
    ) -> HttpResponse:
        """Show the command. The code in it is shown only now."""
        return self._command(request, obj)

    @admin.action(description=_("Make a new command, with a new code"))
    def make_command(self, request: HttpRequest, queryset: QuerySet[BridgeHost]) -> HttpResponse | None:
        """Make a new code for one host, for example after its computer was installed anew."""
        if reason := bridge_hosts.why_not():
            return self._page(request, {"reason": reason})
        if queryset.count() != 1:
            self.message_user(request, gettext("Choose one computer."), messages.ERROR)
            return None
        return self._command(request, queryset.get())

    def _command(self, request: HttpRequest, host: BridgeHost) -> HttpResponse:
        code = bridge_hosts.code_make(host, person_of(request))
        address = f"https://{request.get_host()}{reverse('bridge-host-join')}"
        command = f"sudo script/install-service bridges --join {address} {code}"
        minutes = int(bridge_hosts.CODE_LASTS.total_seconds() / 60)
        return self._page(request, {"host": host, "command": command, "minutes": minutes})

    def _page(self, request: HttpRequest, about: dict[str, Any]) -> HttpResponse:
        context = {
            **self.admin_site.each_context(request),
            "title": gettext("Add a bridge host"),
            "opts": self.opts,
        }
        return TemplateResponse(request, "admin/bridge_host.html", context | about)

    def delete_model(self, request: HttpRequest, obj: BridgeHost) -> None:
        bridge_hosts.remove(obj, person_of(request))
        if obj.joined_at:
            text = (
                gettext(
                    "The computer %s still knows the database's password and FLEET_LINK_SECRET: change both."
                )
                % obj
            )
            self.message_user(request, text, messages.WARNING)

    def has_change_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        """Allow the list and its action; a host has nothing to edit."""
        return obj is None and super().has_change_permission(request)
