"""Sign in to the demo by one press."""

from __future__ import annotations

from typing import Any

from django.conf import settings

from fleet.accounts.sign_in.views import SignInView


class DoorView(SignInView):
    """The sign-in page, filled in: with a password that the demo made for its own accounts, in its own folder."""

    http_method_names = ["post"]

    def get_form_kwargs(self) -> dict[str, Any]:
        """Give the form the name that was pressed, and its password from the demo's file."""
        lines = (settings.FLEET_VAR / "passwords.txt").read_text().splitlines()
        passwords = dict(line.split() for line in lines)
        name = self.request.POST.get("name", "")
        return {**super().get_form_kwargs(), "data": {"username": name, "password": passwords.get(name, "")}}
