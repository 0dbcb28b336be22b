"""``manage.py restore ARCHIVE``: put a backup into an empty place, or beside what is there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from django.core.management.base import BaseCommand, CommandError, CommandParser

from fleet.backup import command_line
from fleet.backup.restoring import Findings, Restored, restore
from fleet.backup.selectors import DONE


class Command(BaseCommand):
    help = (
        "Restores a backup, if no process of the console runs and the database has no people. Until digests and log "
        "are verified, nothing is changed. docs/backup.md tells all steps."
    )
    requires_system_checks: list[str] = []  # the database may not have its tables yet

    def add_arguments(self, parser: CommandParser) -> None:
        parser.add_argument("archive", type=Path, metavar="ARCHIVE")
        parser.add_argument(
            "--replace",
            action="store_true",
            help="also if there are people: their database gets another name",
        )
        parser.add_argument(
            "--despite-findings", action="store_true", help="also if the log is not as it was written"
        )
        parser.add_argument("--passphrase-file", type=Path, metavar="FILE", help=command_line.FILE_HELP)

    def handle(self, *args: Any, archive: Path, passphrase_file: Path | None, **options: Any) -> None:
        """Restore, and tell what else there is to do."""
        with command_line.errors_in_words():
            if not archive.is_file():
                raise CommandError(f"There is no file {archive}.")
            given = command_line.given_passphrase(passphrase_file)
            try:
                done = restore(
                    archive,
                    lambda: given or command_line.asked_passphrase(twice=False),
                    replace=options["replace"],
                    despite_findings=options["despite_findings"],
                )
            except Findings as found:
                for line in command_line.words_of(found.checked):
                    self.stderr.write(line)
                raise CommandError(
                    f"{found} Look into docs/monitoring.md, or give --despite-findings."
                ) from found
        self._tell(done)
        facts = {"archive": archive.name, "made_at": done.checked.manifest.made_at.isoformat()}
        if done.checked.records is not None:
            why = command_line.recorded("backup.restore", DONE, facts, {"kept": done.kept})
            self.stderr.write(why) if why else None

    def _tell(self, done: Restored) -> None:
        for line in command_line.words_of(done.checked):
            self.stdout.write(line)
        if done.kept:
            self.stdout.write(
                f"The database that was there: {done.kept}. Remove it when you no longer need it."
            )
        if done.beside:
            self.stdout.write(f"Settings or meshes of the backup: {done.beside}. Put them where they belong.")
        if not done.same_key:
            self.stderr.write(
                "FLEET_SECRET_KEY is another one than at the backup: set that one, or second factors and webhooks have "
                "to be made again."
            )
        self.stdout.write("Restored. Start the console: sudo systemctl start fleet")
