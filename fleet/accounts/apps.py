"""People as a Django app."""

from django.apps import AppConfig


class AccountsConfig(AppConfig):
    """Records sign-ins and sign-outs, whatever door they came by."""

    name = "fleet.accounts"
    verbose_name = "People"

    def ready(self) -> None:
        """Importing connects the receivers."""
        from fleet.accounts import signals  # noqa: F401
