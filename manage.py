#!/usr/bin/env python
"""Django's command line for the fleet console."""

import os
import sys

from django.core.exceptions import ImproperlyConfigured
from django.core.management import execute_from_command_line
from django.db import OperationalError

from fleet.base import version
from fleet.base.database import schema


def main() -> None:
    """Run a command; print faults for the administrator in words (--traceback shows their place)."""
    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "fleet.settings")
    if sys.argv[1:] in (["version"], ["--version"]):  # Django would print its own
        print(version.release())
        return
    if not schema.UNGUARDED.intersection(sys.argv[1:2]):
        schema.guard()
    try:
        execute_from_command_line(sys.argv)
    except schema.SchemaRefused as refused:
        sys.exit(str(refused))
    except (ImproperlyConfigured, OperationalError) as error:
        if "--traceback" in sys.argv:
            raise
        text = " ".join(str(error).split())
        sys.exit(f"The database cannot be used: {text}" if isinstance(error, OperationalError) else text)


if __name__ == "__main__":
    main()
