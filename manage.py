#!/usr/bin/env python
"""Django's command line for the fleet console."""

import os
import sys

from django.core.exceptions import ImproperlyConfigured
from django.core.management import execute_from_command_line
from django.db import OperationalError


def main() -> None:
    """Run a command; print faults for the administrator in words (--traceback shows their place)."""
    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "fleet.settings")
    try:
        execute_from_command_line(sys.argv)
    except (ImproperlyConfigured, OperationalError) as error:
        if "--traceback" in sys.argv:
            raise
        text = " ".join(str(error).split())
        sys.exit(f"The database cannot be used: {text}" if isinstance(error, OperationalError) else text)


if __name__ == "__main__":
    main()
