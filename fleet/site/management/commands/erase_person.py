"""``manage.py erase_person USERNAME``: erase a person; the audit log can still be verified."""

from __future__ import annotations

from time import sleep
from typing import Any

from django.core.management.base import BaseCommand, CommandError, CommandParser

from fleet.accounts.models import User
from fleet.accounts.services import account_close, account_erase
from fleet.audit.command_line import here
from fleet.base.zones import zone_of
from fleet.bookings.losses.collecting import How, collected
from fleet.bookings.losses.weighing import Seen, weigh
from fleet.bookings.messages.notifications import in_words
from robots.access.signals import publish_access_changed

# Refusals are collected for 10 s before they are recorded, and a refusal of another person may contain the
# name: after this time it is on record and can be erased, too.
WRITTEN_S = 15.0


class Command(BaseCommand):
    """Erase a person for good. For admins at the console's computer."""

    help = (
        "Erases a person: closes the account, takes name, e-mail and password away, replaces the name in the audit log "
        "by a pseudonym and removes their texts and all texts with their name. The log can still be verified."
    )

    def add_arguments(self, parser: CommandParser) -> None:
        parser.add_argument("username")
        parser.add_argument("--yes", action="store_true", help="do not ask")

    def handle(self, *args: Any, username: str, yes: bool, **options: Any) -> None:
        try:
            person = User.objects.get(username=username)
        except User.DoesNotExist:
            raise CommandError(f"There is no account {username}.") from None
        for loss in weigh(lambda: _close(person), actor=here(), seen=None, only_try=True).losses:
            if loss.how is How.TURN:
                continue
            self.stdout.write(f"This ends a booking: {in_words(loss.booking, zone_of(''))}.")
        if (
            not yes
            and input(f"Erase {person.display_name} ({username}) for good? Type the user name: ") != username
        ):
            raise CommandError("Nothing was erased.")
        weigh(lambda: _close(person), actor=here(), seen=Seen(None))
        self.stdout.write(
            f"The account is closed. Waiting for records under way: {WRITTEN_S:.0f} s."
            " If this is interrupted: run it again."
        )
        sleep(WRITTEN_S)
        erasure = account_erase(user=person, actor=here())
        self.stdout.write(
            f"{username} is erased: the contents of {len(erasure.parameters['records'])} records are removed."
        )


def _close(person: User) -> None:
    """Close the account; its bookings end."""
    account_close(user=person)
    publish_access_changed([person.pk])
    if (losses := collected()) is not None:
        losses.for_good = True
