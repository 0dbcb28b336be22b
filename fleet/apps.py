"""The project as an app: its system checks."""

from django.apps import AppConfig


class FleetConfig(AppConfig):
    """Registers the checks."""

    name = "fleet"

    def ready(self) -> None:
        """Importing registers."""
        from fleet import checks  # noqa: F401
