"""script/demo: the whole console on this machine, with three simulated TIAGos."""

from __future__ import annotations

import argparse
import asyncio
import fcntl
import io
import os
import socket
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TextIO

from django.core.exceptions import ImproperlyConfigured

from fleet.base.environment import Environment, lichtblick
from script.stack.places import REPOSITORY
from script.stack.processes import ChildDied, Ended, ended_by_signals, say, wait_for_any_end
from script.stack.stack import (
    MIXED_ROBOTS,
    PRACTICE_ROBOTS,
    PracticeRobot,
    Stack,
    StartError,
    temporary_stack,
)

FIRST_PORT = 8000
PORTS_TRIED = 100
STUDENTS = ("anna", "ben", "cleo", "dana")
DOOR = {"DJANGO_SETTINGS_MODULE": "script.stack.door.settings"}  # not with --lan, where others reach it, too


def main() -> int:
    """Run the command, and return the exit status."""
    asked = arguments()
    try:
        with ended_by_signals():
            if asked.smoke:
                return smoke(asked.mixed)
            robots = MIXED_ROBOTS if asked.mixed else PRACTICE_ROBOTS
            return demo(asked.port, robots, lan=asked.lan, settings=settings(asked))
    except Ended:
        say("Ended.")
        return 0
    except (ImproperlyConfigured, StartError, ChildDied, TimeoutError) as error:
        print(error, file=sys.stderr)
        return 1


def arguments() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(
        prog="script/demo", description="The console with three simulated TIAGos. Ctrl-C ends everything."
    )
    parser.add_argument("--mixed", action="store_true", help="the third robot has ROS 2")
    parser.add_argument("--port", type=int, help=f"default: the first free one from {FIRST_PORT}")
    parser.add_argument("--lan", action="store_true", help="serve phones on this network too, over TLS")
    parser.add_argument("--smoke", action="store_true", help="start, drive a robot, stop it, say so and end")
    parser.add_argument("--lichtblick", metavar="DIR", help="serve this build of Lichtblick at /lichtblick/")
    return parser.parse_args()


def settings(asked: argparse.Namespace) -> dict[str, str]:
    """Return the settings that the command line names. Raises ImproperlyConfigured."""
    chosen = {"FLEET_LICHTBLICK": os.path.abspath(asked.lichtblick)} if asked.lichtblick else {}
    lichtblick(Environment(chosen))
    return chosen


# --- demo -----------------------------------------------------------------------------------------


def demo(port: int | None, robots: Sequence[PracticeRobot], *, lan: bool, settings: dict[str, str]) -> int:
    """Run the demo until a signal comes or a process dies."""
    began_s = time.monotonic()
    listener = listen("0.0.0.0" if lan else "127.0.0.1", port)  # noqa: S104 - that is what --lan asks for
    name = "demo" if robots is PRACTICE_ROBOTS else "demo-mixed"  # a robot keeps its ROS
    directory = REPOSITORY / "var" / f"{name}-{listener.getsockname()[1]}"
    directory.mkdir(mode=0o700, parents=True, exist_ok=True)
    with (directory / "lock").open("w") as lock:
        lock_or_fail(lock, directory)
        with (
            lan_stack(directory, robots, listener, settings)
            if lan
            else Stack(
                directory, robots=robots, listener=listener, students=STUDENTS, settings=DOOR | settings
            ) as stack
        ):
            introduce(stack, time.monotonic() - began_s)
            raise ChildDied(wait_for_any_end(stack.children))


def listen(address: str, port: int | None) -> socket.socket:
    """Listen on `port`, or on the first free port from `FIRST_PORT`."""
    for candidate in [port] if port is not None else range(FIRST_PORT, FIRST_PORT + PORTS_TRIED):
        try:
            return socket.create_server((address, candidate))
        except OSError as error:
            reason = error.strerror
    asked = f"port {port}" if port is not None else f"any port from {FIRST_PORT}"
    raise StartError(f"Cannot listen on {asked}: {reason}.")


def lock_or_fail(lock: TextIO, directory: Path) -> None:
    """Raise `StartError` if another demo uses this directory, also if that demo is ending."""
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise StartError(f"Another demo uses {directory}; try another --port.") from None


def lan_stack(
    directory: Path, robots: Sequence[PracticeRobot], listener: socket.socket, settings: dict[str, str]
) -> Stack:
    """Return a stack that phones on this network can open."""
    from script.stack.certificates import certificate_for, lan_addresses

    addresses = lan_addresses()
    if not addresses:
        raise StartError("This machine has no address in any network: --lan has nobody to serve.")
    hosts = [*addresses, socket.gethostname(), "localhost", "127.0.0.1"]
    return Stack(
        directory,
        robots=robots,
        listener=listener,
        students=STUDENTS,
        certificate=certificate_for(hosts, directory / "tls"),
        hosts=hosts,
        settings=settings,
    )


def introduce(stack: Stack, seconds: float) -> None:
    """Print the address and the passwords."""
    say(f"\nThe console is ready ({seconds:.1f} s):  {stack.url}/\n")
    if stack.certificate:
        say(qr_code(f"{stack.url}/"))
        say("The certificate is this demo's own, so a browser warns once. To have it trusted, install on the")
        say(f"phone: {stack.certificate.authority}\n")
    else:
        say("Its sign-in page has a button for staff, supervisor, operator and observer.\n")
    say("Sign in as        with the password")
    for account in (*stack.accounts.values(), *stack.students):
        course = "   (a student of the course Human-Robot Interaction)" if account.role == "student" else ""
        say(f"  {account.username:<15} {account.password}{course}")
    say(f"\nPasswords: {stack.directory / 'passwords.txt'}   logs: {stack.logs}")
    say("The robots are simulated. Ctrl-C ends everything.")


def qr_code(text: str) -> str:
    """Return a QR code made of characters, for a phone's camera."""
    import segno

    drawn = io.StringIO()
    segno.make(text).terminal(drawn, compact=True)
    return drawn.getvalue()


# --- smoke ----------------------------------------------------------------------------------------


def smoke(mixed: bool) -> int:
    """Drive a robot, if mixed the one with ROS 2, and stop it once, on free ports and in a temporary directory."""
    from script.stack.smoke import drive_and_stop

    began_s = time.monotonic()
    robots = MIXED_ROBOTS if mixed else PRACTICE_ROBOTS
    with temporary_stack(robots) as stack:
        ready_s = time.monotonic() - began_s
        figures = asyncio.run(drive_and_stop(stack, robots[-1 if mixed else 0].slug))
    say(f"smoke: ready in {ready_s:.1f} s, {figures}, {time.monotonic() - began_s:.1f} s in all")
    return 0


if __name__ == "__main__":
    sys.exit(main())
