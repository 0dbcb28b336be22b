"""``manage.py stop SLUG ... | --all``: press the emergency stop of robots, without web process or browser.

This command does not replace a robot's red button. With --all it stops all robots whose bridge runs on this computer
without waiting for the registry, which may not answer. The registry has the robots' names, and the other robots.
"""

from __future__ import annotations

import getpass
import os
import threading
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

from django.conf import settings
from django.core.management.base import BaseCommand, CommandError, CommandParser
from django.db import DatabaseError, connection

from fleet.audit.command_line import here
from robots.registry.models import Robot
from robots.registry.selectors import link_address
from robots.shared.configuration.bridge_config import LinkAddress
from robots.shared.wire import Refusal, Stopped
from teleop.stop.presses import Pending, Result, press_all, press_at, record_outcome, record_press

REGISTRY_S = 3.0  # time limit for the database


class Command(BaseCommand):
    help = "Press the emergency stop of the named robots, or of all."
    requires_system_checks = []  # checks would delay the stop

    def add_arguments(self, parser: CommandParser) -> None:
        parser.add_argument("slugs", nargs="*", metavar="SLUG")
        parser.add_argument("--all", action="store_true", help="every robot")
        parser.add_argument("--reason", default="", help="shown on the robot's page and kept")

    def handle(self, *args: Any, **options: Any) -> None:
        """Stop all robots at the same time, print and record the results, then report robots that were not reached."""
        slugs: list[str] = options["slugs"]
        if options["all"] == bool(slugs):
            raise CommandError("Name robots, or use --all.")
        by, reason = f"{_who()} (command line)", _clean(options["reason"])
        sockets = [] if slugs else _sockets()
        addresses = [(None, LinkAddress(unix_path=path)) for path in sockets]
        with ThreadPoolExecutor(1) as thread:
            pressed = thread.submit(press_at, addresses, by, reason)
            try:
                robots = _registered(slugs).result(REGISTRY_S)
            except (DatabaseError, TimeoutError) as error:
                why = str(error) or f"no answer within {REGISTRY_S:g} s"
                here = dict(zip(sockets, pressed.result(), strict=True))
                self._print_without_registry(slugs, here, why)
                return
            path_of = {robot: link_address(robot).unix_path or "" for robot in robots}
            rest = [robot for robot in robots if path_of[robot] not in sockets]
            results = dict(zip(rest, press_all(rest, by, reason), strict=True))
            here = dict(zip(sockets, pressed.result(), strict=True))
        results |= {robot: here.pop(path) for robot, path in path_of.items() if path in here}
        # With --all, report a disabled robot only if its bridge still runs and was stopped.
        meant = [robot for robot in robots if slugs or robot.enabled or isinstance(results[robot], Stopped)]
        left = [*here.values(), *(results[robot] for robot in results.keys() - set(meant))]
        for result in left:
            if isinstance(result, Pending):
                result.withdraw()
        self._print_results({robot: results[robot] for robot in meant}, reason)
        unknown = sorted(set(slugs) - {robot.slug for robot in robots})
        if unknown:
            raise CommandError(f"There is no robot {', '.join(unknown)}.")

    def _print_results(self, results: dict[Robot, Result], reason: str) -> None:
        """Print the results, then record them, which may take time; last, report the robots that were not reached."""
        for robot, result in results.items():
            self.stdout.write(f"{robot.slug}: {_in_words(result)}")
        for robot, result in results.items():
            self._record(robot, reason, result)
        refused = [robot.slug for robot, result in results.items() if isinstance(result, Refusal)]
        pending = [robot.slug for robot, result in results.items() if isinstance(result, Pending)]
        words = []
        if refused:
            words.append(f"Not reached: {', '.join(refused)}.")
        if pending:
            words.append(
                f"Pending, not confirmed yet: {', '.join(pending)}. The supervisor, the web processes and a bridge "
                "that starts deliver the stop as soon as they can."
            )
        if words:
            raise CommandError(f"{' '.join(words)} Use the red button on the robot.")

    def _print_without_registry(self, slugs: list[str], results: dict[str, Result], why: str) -> None:
        """Print the results without the robots' names, because these are only in the registry."""
        if slugs:
            raise CommandError(
                f"The database does not answer, so the names of robots are not known ({why}). Use --all."
            )
        for path, result in results.items():
            self.stdout.write(f"{Path(path).name}: {_in_words(result)}")
        stopped = sum(isinstance(result, Stopped) for result in results.values())
        raise CommandError(
            f"The database does not answer ({why}). All bridges on this computer were asked: {stopped} robots are "
            f"stopping, {len(results) - stopped} did not answer; their stop is pending. Nothing was recorded, and "
            "bridges on other computers were not reached. Use the red button on the other robots."
        )

    def _record(self, robot: Robot, reason: str, result: Result) -> None:
        pressed = record_press(robot.id, actor=here(), through="command line", reason=reason)
        record_outcome(pressed, actor=here(), result=result)
        if pressed is None:
            self.stderr.write(f"{robot.slug}: not recorded, see the log")


def _sockets() -> list[str]:
    """Return the path of the bridge's socket for each robot with a bridge or watchdog on this computer.

    The watchdog's socket counts too, because a restarting bridge has no socket.
    """
    found = [path for kind in ("*.sock", "*.stop") for path in settings.FLEET_RUN_DIR.glob(kind)]
    return sorted({str(path.with_suffix(".sock")) for path in found})


def _registered(slugs: list[str]) -> Future[list[Robot]]:
    """Read these robots, or all, in a daemon thread, so that a database that hangs does not block the process."""
    answer: Future[list[Robot]] = Future()

    def ask() -> None:
        try:
            answer.set_result(list(Robot.objects.filter(slug__in=slugs) if slugs else Robot.objects.all()))
        except DatabaseError as error:
            answer.set_exception(error)
        finally:
            connection.close()

    threading.Thread(target=ask, name="registry", daemon=True).start()
    return answer


def _who() -> str:
    """Return the name of the account that runs this command, or its number if it has no name."""
    try:
        return _clean(getpass.getuser())[:100]
    except (KeyError, OSError):
        return f"uid {os.getuid()}"


def _clean(text: str) -> str:
    """Return a text of the command line as valid UTF-8 (a terminal may use any encoding), at most 200 characters."""
    return text.encode(errors="replace").decode()[:200]


def _in_words(result: Result) -> str:
    match result:
        case Pending():
            return result.refusal.text
        case Refusal():
            return result.text
        case _:
            return "stopping"
