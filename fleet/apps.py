"""The project as an app: its system checks."""

from django.apps import AppConfig
from django.contrib.staticfiles.apps import StaticFilesConfig


class FleetConfig(AppConfig):
    """Registers the checks."""

    name = "fleet"
    default = True  # of the two configurations in this module

    def ready(self) -> None:
        """Importing registers."""
        from fleet import checks  # noqa: F401


class StaticFiles(StaticFilesConfig):
    """Leaves out what pages do not load."""

    ignore_patterns = [
        *StaticFilesConfig.ignore_patterns,
        *("swagger-ui-es-*", "swagger-ui-standalone-*", "swagger-initializer.js", "absolute-path.js"),
        *("oauth2-redirect.*", "log.*.txt", "*.LICENSE.txt", "NOTICE", "LICENSE", "package.json"),
    ]
