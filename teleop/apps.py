from django.apps import AppConfig
from django.utils.translation import gettext_lazy as _


class TeleopConfig(AppConfig):
    name = "teleop"
    verbose_name = _("Control")

    def ready(self) -> None:
        """Import the modules that connect signal receivers."""
        from teleop.control import signals  # noqa: F401
        from teleop.control.waiting import turns  # noqa: F401
        from teleop.push import services  # noqa: F401
        from teleop.recordings import erasure  # noqa: F401
