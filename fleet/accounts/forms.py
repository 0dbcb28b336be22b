"""The sign-in form."""

from __future__ import annotations

from math import ceil
from typing import Any, cast

from django import forms
from django.conf import settings
from django.contrib.auth.forms import AuthenticationForm
from django.core.exceptions import ValidationError
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy, ngettext

from fleet import zones
from fleet.accounts import hashing, services, throttle

THROTTLED = "throttled"
BUSY = "busy"


class SettingsForm(forms.Form):
    """What a person chooses for themselves."""

    time_zone = forms.ChoiceField(label=gettext_lazy("Time zone"), required=False)

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        lab = _("as the lab: %(zone)s") % {"zone": settings.TIME_ZONE}
        cast(forms.ChoiceField, self.fields["time_zone"]).choices = [
            ("", lab),
            (zones.UTC, zones.UTC),
            *zones.choices(),
        ]


class SignInForm(AuthenticationForm):
    """User name and password; does not even look at the password while the name must wait."""

    wait_s = 0.0

    def clean(self) -> dict[str, Any]:
        """Refuse with code "throttled" or "busy", or check the password."""
        username = self.cleaned_data.get("username")
        if not (username and self.cleaned_data.get("password")):
            return super().clean()
        address = services.address_of(self.request) if self.request else ""
        try:
            with throttle.attempt(username=username, address=address):
                return super().clean()
        except throttle.TooMany as error:
            if error.wait_s:
                self.wait_s = error.wait_s
                raise self._throttled() from error
            raise self._busy() from error
        except hashing.HashingBusy as error:
            raise self._busy() from error

    def _throttled(self) -> ValidationError:
        minutes = ceil(self.wait_s / 60)
        text = ngettext(
            "Too many failed attempts for this name, or from this address. Try again in %(minutes)d minute.",
            "Too many failed attempts for this name, or from this address. Try again in %(minutes)d minutes.",
            minutes,
        )
        return ValidationError(text, code=THROTTLED, params={"minutes": minutes})

    def _busy(self) -> ValidationError:
        self.wait_s = hashing.RETRY_AFTER_S
        return ValidationError(_("Many people sign in at this moment. Try again in a moment."), code=BUSY)
