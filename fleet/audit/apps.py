"""The audit log as a Django app."""

from django.apps import AppConfig
from django.utils.translation import gettext_lazy as _


class AuditConfig(AppConfig):
    """The app. It must not import from the apps above."""

    name = "fleet.audit"
    verbose_name = _("Audit log")
