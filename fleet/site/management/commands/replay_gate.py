"""``manage.py replay_gate FILE``: run a recorded drive through the gate again, offline.

FILE is a trace of ``script/bench gate --record``, or a rosbag together with ``--robot SLUG``.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from django.core.management.base import BaseCommand, CommandError, CommandParser

from robots.bridge.gate.gate import Gate
from robots.bridge.gate_trace import BadTrace, replay
from robots.registry.configuration.profile_schema import Problems
from robots.registry.models import Robot
from robots.registry.selectors import bridge_config
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.records.verdict import Verdict


class Command(BaseCommand):
    help = "Run a recorded drive through the gate; exit 1 if a verdict differs from the recorded one."

    def add_arguments(self, parser: CommandParser) -> None:
        parser.add_argument("file", type=Path, metavar="FILE")
        parser.add_argument("--robot", metavar="SLUG", help="FILE is a rosbag of this robot")

    def handle(self, *args: Any, **options: Any) -> None:
        """Print changes of the verdict, and how many decisions equal the recorded ones."""
        try:
            if options["robot"]:
                self._bag(options["file"], options["robot"])
            else:
                self._trace(options["file"])
        except BadTrace as error:
            raise CommandError(str(error)) from error

    def _trace(self, file: Path) -> None:
        decisions = differing = 0
        began_s = last = None
        for decision in replay(file):
            began_s = decision.now_s if began_s is None else began_s
            decisions += 1
            last = self._print_change(decision.now_s - began_s, decision.replayed, last)
            if not decision.same:
                differing += 1
                self.stdout.write(self.style.ERROR(f"        recorded: {_words(decision.recorded)}"))
        self.stdout.write(f"{decisions} decisions, {differing} other than recorded")
        if differing:
            sys.exit(1)

    def _bag(self, file: Path, slug: str) -> None:
        from robots.bridge.ros.sensors import bag  # import ROS only when it is needed

        config = _config(slug)
        decisions = 0
        began_s = last = None
        for at_s, verdict in bag.drive(file, Gate(config.gate), config.topics):
            began_s = at_s if began_s is None else began_s
            decisions += 1
            last = self._print_change(at_s - began_s, verdict, last)
        self.stdout.write(f"{decisions} decisions")

    def _print_change(
        self, at_s: float, verdict: Verdict, last: tuple[str, str | None] | None
    ) -> tuple[str, str | None]:
        """Print a verdict if its kind differs from the last one."""
        kind = verdict.code, verdict.sensor
        if kind != last:
            self.stdout.write(f"{at_s:8.2f} {_words(verdict)}")
        return kind


def _config(slug: str) -> BridgeConfig:
    robot = Robot.objects.select_related("profile").filter(slug=slug).first()
    if robot is None:
        raise CommandError(f"There is no robot {slug!r}.")
    try:
        return bridge_config(robot)
    except Problems as problems:
        raise CommandError(f"{robot.name} cannot be driven as it is registered: {problems}") from problems


def _words(verdict: Verdict) -> str:
    asked, allowed = (
        " ".join(f"{speed:+.2f}" for speed in twist) for twist in (verdict.asked, verdict.velocity)
    )
    return f"{verdict.code:<16} asked {asked}, allowed {allowed}  {verdict.text}".rstrip()
