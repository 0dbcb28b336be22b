"""The sign-in form."""

from __future__ import annotations

from math import ceil
from typing import Any

from django.contrib.auth.forms import AuthenticationForm
from django.core.exceptions import ValidationError
from django.utils.translation import ngettext

from fleet.accounts import services, throttle

THROTTLED = "throttled"


class SignInForm(AuthenticationForm):
    """User name and password; does not even look at the password while the name must wait."""

    wait_s = 0.0

    def clean(self) -> dict[str, Any]:
        """Refuse with code "throttled", or check the password."""
        username = self.cleaned_data.get("username")
        if username and self.request:
            self.wait_s = throttle.wait_s(username=username, address=services.address_of(self.request))
        if self.wait_s > 0:
            minutes = ceil(self.wait_s / 60)
            text = ngettext(
                "Too many failed attempts for this name, or from this address. Try again in %(minutes)d minute.",
                "Too many failed attempts for this name, or from this address. Try again in %(minutes)d minutes.",
                minutes,
            )
            raise ValidationError(text, code=THROTTLED, params={"minutes": minutes})
        return super().clean()
