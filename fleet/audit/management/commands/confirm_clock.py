"""``manage.py confirm_clock``: allow expiry of the audit log again after a long time without records."""

from __future__ import annotations

from typing import Any

from django.core.management.base import BaseCommand, CommandError
from django.utils import timezone

from fleet.audit import retention
from fleet.audit.command_line import here
from fleet.audit.errors import AuditUnavailable


class Command(BaseCommand):
    """Confirm the clock. For an admin who has checked that its time is right."""

    help = (
        "Record that the clock of this computer is right, so that housekeeping removes contents of the audit log that "
        "are too old, although the log had a long gap before."
    )

    def handle(self, *args: Any, **options: Any) -> None:
        try:
            retention.confirm_clock(here())
        except AuditUnavailable as error:
            raise CommandError(error.text) from error
        now = timezone.now().isoformat(" ", "minutes")
        self.stdout.write(
            f"On record: it is {now}. Records that are too old go within a day, or now: run_housekeeping --once"
        )
