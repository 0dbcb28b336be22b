"""``manage.py remove_second_factor USERNAME``: for the last admin whose phone and recovery codes are lost."""

from __future__ import annotations

from typing import Any

from django.core.management.base import BaseCommand, CommandError, CommandParser

from fleet.accounts.models import User
from fleet.accounts.sign_in.second_factor import second_factors_remove


class Command(BaseCommand):
    help = "Removes the second factors and recovery codes of a person, who then signs in by password alone."

    def add_arguments(self, parser: CommandParser) -> None:
        parser.add_argument("username")

    def handle(self, *args: Any, username: str, **options: Any) -> None:
        """Remove the second factors.

        The actor in the record is the computer account that runs the command.
        """
        try:
            person = User.objects.get(username=username)
        except User.DoesNotExist:
            raise CommandError(f"There is no account {username}.") from None
        if not second_factors_remove(person):
            raise CommandError(f"{username} has no second factor.")
        self.stdout.write(f"{username} signs in by password alone now.")
