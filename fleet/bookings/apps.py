"""Bookings as a Django app."""

from django.apps import AppConfig
from django.utils.translation import gettext_lazy as _


class BookingsConfig(AppConfig):
    """The app. It registers its triggers, so that the audit log's verification expects them."""

    name = "fleet.bookings"
    verbose_name = _("Bookings")

    def ready(self) -> None:
        """Register the triggers and the receivers."""
        from fleet.audit.integrity import triggers
        from fleet.base.web.time_takers import use_door
        from fleet.bookings import overlaps
        from fleet.bookings.changes import policy_changes, waiting_list  # noqa: F401 - they receive signals
        from fleet.bookings.losses import lost_rights, undo  # noqa: F401 - they receive signals
        from fleet.bookings.losses.door import through_door

        use_door(through_door)
        triggers.expect("sqlite", overlaps.TRIGGERS)
