"""``manage.py setup_code``: a new one-time code for the page /setup/, while nobody has an account."""

from __future__ import annotations

from typing import Any

from django.core.management.base import BaseCommand

from fleet.accounts.sign_in.first_run import code_make


class Command(BaseCommand):
    """Print the code, alone on a line; nothing once the console is set up."""

    help = "Make and print the one-time code of a new installation. Earlier codes end."

    def handle(self, *_arguments: Any, **_options: Any) -> None:
        if code := code_make():
            self.stdout.write(code)
