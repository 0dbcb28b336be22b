from django.apps import AppConfig
from django.utils.translation import gettext_lazy as _


class TeleopConfig(AppConfig):
    name = "teleop"
    verbose_name = _("Control")

    def ready(self) -> None:
        """Import the module that connects the signal receiver."""
        from teleop.control import signals  # noqa: F401
