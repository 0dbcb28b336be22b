"""``python -m benchmarks.attacks.command_line_side``: manage.py stop, once for each line of stdin."""

from __future__ import annotations

import io
import os
import sys

import django
from django.core.management import call_command
from django.core.management.base import CommandError

from benchmarks.driving.stop import ROBOT


def main() -> None:
    """Print "ready", then the result for each line."""
    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "fleet.settings")
    django.setup()
    import fleet.site.management.commands.stop  # noqa: F401  (loaded before the first press)

    print("ready", flush=True)
    for _ in sys.stdin:
        try:
            call_command("stop", ROBOT, stdout=io.StringIO(), stderr=io.StringIO())
        except CommandError as error:
            print("pending" if "Pending" in str(error) else f"{error}".replace("\n", " "), flush=True)
        else:
            print("stopped", flush=True)


if __name__ == "__main__":
    main()
