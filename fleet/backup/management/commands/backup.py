"""``manage.py backup TARGET``: one archive of the console, while everything runs. ``--check ARCHIVE`` checks one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from django.core.management.base import BaseCommand, CommandError, CommandParser

from fleet.backup import command_line
from fleet.backup.checking import backup_check
from fleet.backup.selectors import DONE, FAILED
from fleet.backup.services import Made, Wishes, backup_make, forget_old


class Command(BaseCommand):
    help = (
        "Writes a backup while everything runs: one archive with the database (people, robots, maps, bookings, log) "
        "and the heads of the log. docs/backup.md tells how to restore it."
    )
    requires_system_checks: list[str] = []  # also in trouble

    def add_arguments(self, parser: CommandParser) -> None:
        parser.add_argument("target", nargs="?", type=Path, metavar="TARGET", help="a folder, or a new file")
        parser.add_argument(
            "--with-settings", action="store_true", help="also secret key and settings (FLEET_…)"
        )
        parser.add_argument("--with-meshes", action="store_true", help="also meshes of robots (FLEET_MESHES)")
        parser.add_argument(
            "--encrypt", action="store_true", help="by a passphrase; without this, if one is given or set"
        )
        parser.add_argument("--passphrase-file", type=Path, metavar="FILE", help=command_line.FILE_HELP)
        parser.add_argument(
            "--keep", type=int, metavar="NUMBER", help="then remove this computer's archives but the newest"
        )
        parser.add_argument("--verify", action="store_true", help="then check the archive")
        parser.add_argument(
            "--check", type=Path, metavar="ARCHIVE", help="only check this archive: restore it for a moment"
        )

    def handle(self, *args: Any, target: Path | None, check: Path | None, **options: Any) -> None:
        """Make a backup, or check one."""
        if (target is None) == (check is None):
            raise CommandError("Name a folder or file for the backup, or an archive with --check.")
        with command_line.errors_in_words():
            passphrase = command_line.given_passphrase(options["passphrase_file"])
            if check:
                self._check(check, passphrase)
                return
            if options["encrypt"] and not passphrase:
                passphrase = command_line.asked_passphrase(twice=True)
            self._make(target, passphrase, options)

    def _make(self, target: Any, passphrase: str | None, options: dict[str, Any]) -> None:
        if (keep := options["keep"]) is not None and (keep < 1 or not target.is_dir()):
            raise CommandError("--keep is 1 or more, and TARGET a folder.")
        ending = ".tar.gz.age" if passphrase else ".tar.gz"
        if not target.is_dir() and not target.name.endswith(ending):
            raise CommandError(f"There is no folder {target}. The name of a file ends with {ending} here.")
        wishes = Wishes(options["with_settings"], options["with_meshes"], passphrase)
        try:
            made = backup_make(target, wishes)
        except Exception as error:
            command_line.recorded("backup.make", FAILED, {}, {"why": str(error)})
            raise
        self._tell(made, wishes)
        if options["verify"]:
            self._check(made.path, passphrase)
        for path in forget_old(target, keep) if keep else ():
            self.stdout.write(f"Removed {path.name}.")

    def _tell(self, made: Made, wishes: Wishes) -> None:
        self.stdout.write(f"{made.path}: {made.size / 1e6:.1f} MB.")
        if wishes.settings and not wishes.passphrase:
            self.stderr.write("It has the secret key and is not encrypted: keep it like a key.")
        facts = {"archive": made.path.name, "bytes": made.size, "encrypted": bool(wishes.passphrase)}
        self._complain(command_line.recorded("backup.make", DONE, facts, {"path": str(made.path)}))

    def _check(self, archive: Path, passphrase: str | None) -> None:
        facts = {"archive": archive.name}
        try:
            checked = backup_check(archive, lambda: passphrase or command_line.asked_passphrase(twice=False))
        except Exception as error:
            command_line.recorded("backup.check", FAILED, facts, {"why": str(error)})
            raise
        for line in command_line.words_of(checked):
            self.stdout.write(line)
        outcome = FAILED if checked.findings else DONE
        self._complain(
            command_line.recorded("backup.check", outcome, facts | {"records": checked.records}, {})
        )
        if checked.findings:
            raise CommandError("The log in this backup is not as it was written: see docs/monitoring.md.")

    def _complain(self, why: str) -> None:
        if why:
            self.stderr.write(why)
