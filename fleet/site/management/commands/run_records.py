"""``manage.py run_records``: write the records of this computer's bridges. The fleet supervisor starts it.

When stdin ends, because the fleet supervisor has ended, it waits for the last records of the bridges.
"""

from __future__ import annotations

import sys
from typing import Any

from django.conf import settings
from django.core.management.base import BaseCommand
from django.db import connections

from fleet.base.database.schema import begin
from robots.records.record_server import serve
from robots.shared.processes.shutdown import end_event
from robots.shared.records.calls import SOCKET

END_S = 6.0  # longer than the end of a bridge


class Command(BaseCommand):
    help = "Write the records of this computer's bridges, until stdin ends."
    requires_system_checks = []  # the fleet supervisor ran the checks; nothing can be recorded until this runs

    def handle(self, *args: Any, **options: Any) -> None:
        """Serve all bridges."""
        begin("records")
        ended = end_event(sys.stdin.fileno(), END_S)
        # Each bridge's thread keeps its connection open: opening one is slower than writing a record.
        connections.settings["default"].update(CONN_MAX_AGE=None, CONN_HEALTH_CHECKS=True)
        serve(settings.FLEET_RUN_DIR / SOCKET, ended)
