"""``manage.py export_phrases --profile SLUG | --robot SLUG``: print phrases in the format of a text file."""

from __future__ import annotations

from typing import Any

from django.core.management.base import BaseCommand, CommandParser

from robots.registry import phrases
from robots.registry.management.owner import add_owner_arguments, owner_in


class Command(BaseCommand):
    """Export phrases."""

    help = "Export phrases to standard output, in the format of import_phrases."

    def add_arguments(self, parser: CommandParser) -> None:
        """Add the options that name the owner."""
        add_owner_arguments(parser)

    def handle(self, *args: Any, **options: Any) -> None:
        """Print the phrases in their order."""
        held = owner_in(options).phrases.all()
        self.stdout.write(phrases.file_text(phrase.line for phrase in held), ending="")
