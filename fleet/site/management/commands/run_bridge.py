"""``manage.py run_bridge SLUG``: the bridge process of one robot. The fleet supervisor starts it.

When stdin ends, because the fleet supervisor has ended, the bridge stops the robot and exits.
"""

from __future__ import annotations

import sys
from typing import Any

from django.core.management.base import BaseCommand, CommandError, CommandParser
from django.db import connections

from fleet.base.schema import begin
from robots.bridge.process import run
from robots.records.bridge_records import AuditSink
from robots.registry.configuration.profile_schema import Problems
from robots.registry.models import Robot
from robots.registry.selectors import bridge_config, require_link_settings
from robots.shared.processes import last_words
from robots.shared.sentences import say


class Command(BaseCommand):
    help = "Run the bridge of one robot, until stdin ends."
    requires_system_checks = []  # the fleet supervisor ran the checks; a bridge must restart quickly

    def add_arguments(self, parser: CommandParser) -> None:
        parser.add_argument("slug")

    def handle(self, *args: Any, **options: Any) -> None:
        """Run the bridge with plain values and a sink for its records."""
        begin(f"bridge of {options['slug']}")
        robot = Robot.objects.select_related("profile").filter(slug=options["slug"]).first()
        if robot is None:
            raise CommandError(f"There is no robot {options['slug']!r}.")
        try:
            require_link_settings(robot)
            config = bridge_config(robot)
        except Problems as problems:
            raise CommandError(f"The entry of {robot.slug} is wrong: {problems}") from problems
        connections.close_all()
        # A separate thread writes records and keeps its connection open: opening one is slower than writing a record.
        connections.settings["default"].update(CONN_MAX_AGE=None, CONN_HEALTH_CHECKS=True)
        try:
            code = run(config, AuditSink(robot.id, robot.name))
        except Exception as error:
            if config.link.unix_path:
                words = say("it failed ({kind}: {error})", kind=type(error).__name__, error=error)
                last_words.write(config.link.unix_path, last_words.LAST, words)
            raise
        sys.exit(code)
