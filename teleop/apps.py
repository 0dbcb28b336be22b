from django.apps import AppConfig
from django.utils.translation import gettext_lazy as _


class TeleopConfig(AppConfig):
    name = "teleop"
    verbose_name = _("Control")

    def ready(self) -> None:
        """Import the modules that connect the signal receiver and extend the schema."""
        from teleop.api.v1.framework import schema  # noqa: F401
        from teleop.control import signals  # noqa: F401
