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
            "--encrypt", action="store_true", help="ask for a passphrase, or fail, if none is given or set"
        )
        parser.add_argument("--passphrase-file", type=Path, metavar="FILE", help=command_line.FILE_HELP)
        parser.add_argument(
            "--keep", type=int, metavar="NUMBER", help="then remove this console's archives but the newest"
        )
        parser.add_argument("--verify", action="store_true", help="then check the archive")
        parser.add_argument(
            "--check", type=Path, metavar="ARCHIVE", help="only check this archive: restore it for a moment"
        )

    def handle(self, *args: Any, target: Path | None, check: Path | None, **options: Any) -> None:
        """Make a backup, or check one."""
        with command_line.errors_in_words():
            if target is not None and check is None:
                self._make(target, options)
            elif check is not None and target is None:
                self._check(check, command_line.given_passphrase(options["passphrase_file"]))
            else:
                raise CommandError("Name a folder or file for the backup, or an archive with --check.")

    def _make(self, target: Path, options: dict[str, Any]) -> None:
        keep: int | None = options["keep"]
        with command_line.failure_recorded("backup.make", {}):
            passphrase = command_line.given_passphrase(options["passphrase_file"])
            if options["encrypt"] and not passphrase:
                passphrase = command_line.asked_passphrase(twice=True)
            wishes = Wishes(options["with_settings"], options["with_meshes"], passphrase)
            self._require_place(target, keep, wishes)
            made = backup_make(target, wishes)
        self._tell(made, wishes)
        if options["verify"]:
            self._check(made.path, passphrase)
        for path in forget_old(target, keep) if keep else ():
            self.stdout.write(f"Removed {path.name}.")

    def _require_place(self, target: Path, keep: int | None, wishes: Wishes) -> None:
        """Raise CommandError for a folder that is missing, as one that is not mounted: it is not to become a file."""
        ending = ".tar.gz.age" if wishes.passphrase else ".tar.gz"
        if not target.is_dir() and not target.name.endswith(ending):
            raise CommandError(f"There is no folder {target}. The name of a file ends with {ending} here.")
        if keep is not None and (keep < 1 or not target.is_dir()):
            raise CommandError("--keep is 1 or more, and TARGET a folder.")

    def _tell(self, made: Made, wishes: Wishes) -> None:
        self.stdout.write(f"{made.path}: {made.size / 1e6:.1f} MB.")
        if wishes.settings and not wishes.passphrase:
            self.stderr.write("It has the secret key and is not encrypted: keep it like a key.")
        facts = {"archive": made.path.name, "bytes": made.size, "encrypted": bool(wishes.passphrase)}
        self._complain(command_line.recorded("backup.make", DONE, facts, {"path": str(made.path)}))

    def _check(self, archive: Path, passphrase: str | None) -> None:
        facts = {"archive": archive.name}
        with command_line.failure_recorded("backup.check", facts):
            checked = backup_check(archive, lambda: passphrase or command_line.asked_passphrase(twice=False))
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
