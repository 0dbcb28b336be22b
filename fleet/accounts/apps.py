"""People as a Django app."""

from django.apps import AppConfig
from django.utils.translation import gettext_lazy as _


class AccountsConfig(AppConfig):
    """The app. It records sign-ins and sign-outs of every interface."""

    name = "fleet.accounts"
    verbose_name = _("People")

    def ready(self) -> None:
        """Connect the receivers of signals, by importing them."""
        from fleet.accounts import signals  # noqa: F401
