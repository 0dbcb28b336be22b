"""``manage.py make_token USERNAME NAME SCOPE...``: a token for a program, printed once."""

from __future__ import annotations

from datetime import timedelta
from typing import Any

from django.core.management.base import BaseCommand, CommandError, CommandParser
from django.utils import timezone

from fleet.accounts.models import User
from fleet.accounts.tokens.models import Scope
from fleet.accounts.tokens.services import TooManyTokens, token_make
from fleet.audit.command_line import here


class Command(BaseCommand):
    help = "Makes a token with which a program signs in as this person, and prints it once."
    requires_system_checks = []  # the fleet supervisor ran the checks, which take longer than the token

    def add_arguments(self, parser: CommandParser) -> None:
        parser.add_argument("username")
        parser.add_argument(
            "name", help="what the program is, such as night-tests: people see it beside the name"
        )
        parser.add_argument("scopes", nargs="+", choices=[scope.value for scope in Scope])
        parser.add_argument("--days", type=int, default=90, help="until it expires (default: 90)")

    def handle(self, *args: Any, **options: Any) -> None:
        person = User.objects.filter(username=options["username"], is_active=True).first()
        if person is None:
            raise CommandError("There is no open account with this user name.")
        try:
            _, text = token_make(
                user=person,
                name=options["name"][:40],
                scopes=[Scope(name) for name in options["scopes"]],
                expires_at=timezone.now() + timedelta(days=max(options["days"], 1)),
                actor=here(),
            )
        except TooManyTokens as error:
            raise CommandError("This person has too many valid tokens: end one of them first.") from error
        self.stdout.write(text)
