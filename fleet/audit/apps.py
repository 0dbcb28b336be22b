"""The audit log as a Django app."""

from django.apps import AppConfig


class AuditConfig(AppConfig):
    """Knows nothing of the apps above."""

    name = "fleet.audit"
    verbose_name = "Audit log"
