"""Access as a Django app."""

from django.apps import AppConfig
from django.utils.translation import gettext_lazy as _


class AccessConfig(AppConfig):
    """Courses, robot groups and qualifications."""

    name = "robots.access"
    label = "access"
    verbose_name = _("Access")

    def ready(self) -> None:
        """Register the receivers, which need the models."""
        from robots.access import enrolment  # noqa: F401
        from robots.access.sign_in_rules import rules  # noqa: F401
