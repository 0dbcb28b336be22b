"""``manage.py run_store``: move this computer's recordings into the object store. The fleet supervisor starts it.

It ends when stdin ends, because the fleet supervisor has ended; an upload goes on when it runs again.
"""

from __future__ import annotations

import os
import sys
from typing import Any

from django.conf import settings
from django.core.management.base import BaseCommand, CommandError

from fleet.base.database.schema import begin
from robots.bridge.recorder.erasing.__main__ import cut_file
from robots.bridge.recorder.files.directory import RecordingDirectory
from robots.recordings.s3.store_work import work
from robots.shared.processes.shutdown import end_event

END_S = 2.0
NICE = 10  # robots and pages go first


class Command(BaseCommand):
    help = "Move this computer's recordings into the object store, until stdin ends."
    requires_system_checks = []  # the fleet supervisor ran the checks

    def handle(self, *args: Any, **options: Any) -> None:
        """Work until the end."""
        if settings.FLEET_S3 is None:
            raise CommandError("FLEET_S3_URL is not set.")
        begin("store")
        ended = end_event(sys.stdin.fileno(), END_S)
        os.nice(NICE)
        place = settings.FLEET_RECORDINGS
        work(
            settings.FLEET_S3,
            RecordingDirectory(place, settings.FLEET_RECORDINGS_BYTES) if place else None,
            ended,
            settings.FLEET_VAR / "store",
            cut_file,
        )
