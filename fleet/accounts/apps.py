"""People as a Django app."""

from django.apps import AppConfig
from django.utils.translation import gettext_lazy as _


class AccountsConfig(AppConfig):
    """The app. It records sign-ins and sign-outs of every interface."""

    name = "fleet.accounts"
    verbose_name = _("People")
    default = True  # this module has two configurations

    def ready(self) -> None:
        """Connect the receivers of signals, by importing them."""
        from fleet.accounts import signals  # noqa: F401


class Models(AppConfig):
    """The app in a process where nobody signs in."""

    name = "fleet.accounts"
