"""``manage.py import_phrases FILE --profile SLUG | --robot SLUG``: add the phrases of a text file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from django.core.management.base import BaseCommand, CommandError, CommandParser

from fleet.audit.command_line import here
from robots.registry import phrases
from robots.registry.configuration.profile_schema import Problems
from robots.registry.management.owner import add_owner_arguments, owner_in
from robots.registry.selectors import first_language
from robots.registry.services import phrases_import


class Command(BaseCommand):
    """Import phrases."""

    help = (
        "Import phrases from a text file, one a line: language, tab, text; or the text alone. Tags may follow after "
        "another tab, separated by commas. If one line is wrong, nothing is imported."
    )

    def add_arguments(self, parser: CommandParser) -> None:
        """Add the options: file, owner and mode."""
        parser.add_argument("file", type=Path)
        add_owner_arguments(parser)
        parser.add_argument("--language", help="for lines without a language (default: the robot's first)")
        parser.add_argument("--replace", action="store_true", help="replace the existing phrases")

    def handle(self, *args: Any, **options: Any) -> None:
        """Import the whole file or nothing."""
        owner = owner_in(options)
        language = options["language"] or first_language(owner)
        if why := phrases.why_no_language(language):
            raise CommandError(why)
        try:
            lines = phrases.read_file(options["file"], language)
        except OSError as error:
            raise CommandError(f"{options['file']} cannot be read: {error.strerror}.") from error
        except Problems as problems:
            raise CommandError("\n".join(["Nothing was imported.", *problems.lines])) from problems
        new = phrases_import(owner=owner, lines=lines, actor=here(), replace=options["replace"])
        self.stdout.write(f"{owner}: {new} new phrases.")
