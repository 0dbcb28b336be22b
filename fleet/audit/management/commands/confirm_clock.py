"""``manage.py confirm_clock``: after a long silence, what is too old by today's date may go from the audit log."""

from __future__ import annotations

from typing import Any

from django.core.management.base import BaseCommand, CommandError
from django.utils import timezone

from fleet.audit import retention
from fleet.audit.command_line import here
from fleet.audit.errors import AuditUnavailable


class Command(BaseCommand):
    """For whoever has looked at the clock."""

    help = (
        "Puts on record that the clock of this computer is right, so that housekeeping takes out of the audit log what "
        "is too old by it, although nothing was recorded for long before."
    )

    def handle(self, *args: Any, **options: Any) -> None:
        """Say what the clock shows, and believe it."""
        try:
            retention.confirm_clock(here())
        except AuditUnavailable as error:
            raise CommandError(error.text) from error
        now = timezone.now().isoformat(" ", "minutes")
        self.stdout.write(
            f"On record: it is {now}. Records that are too old go within a day, or now: run_housekeeping --once"
        )
