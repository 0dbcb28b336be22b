"""The project as an app: its system checks."""

from django.apps import AppConfig
from django.contrib.staticfiles.apps import StaticFilesConfig


class FleetConfig(AppConfig):
    """The app. It registers the checks."""

    name = "fleet.site"
    label = "fleet"
    default = True  # this module has two configurations

    def ready(self) -> None:
        """Register the checks, by importing them."""
        from fleet.site import checks  # noqa: F401


class StaticFiles(StaticFilesConfig):
    """Static files, without files that no page loads."""

    ignore_patterns = [
        *StaticFilesConfig.ignore_patterns,
        *("swagger-ui-es-*", "swagger-ui-standalone-*", "swagger-initializer.js", "absolute-path.js"),
        *("oauth2-redirect.*", "log.*.txt", "*.LICENSE.txt", "NOTICE", "LICENSE", "package.json"),
    ]


class Commands(AppConfig):
    """The app in a process that needs only its commands."""

    name = "fleet.site"
    label = "fleet"
