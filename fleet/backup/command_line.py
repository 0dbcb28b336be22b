"""Parts that the commands share: the passphrase, errors in words, records of what was done."""

from __future__ import annotations

import getpass
import sqlite3
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psycopg
from django.conf import settings
from django.core.management.base import CommandError
from django.db import DatabaseError

from fleet.audit.command_line import here
from fleet.audit.errors import AuditUnavailable
from fleet.audit.services import record
from fleet.backup.checking import Checked
from fleet.backup.errors import BackupError
from fleet.backup.selectors import FAILED

SHOWN = 20  # findings
FILE_HELP = "file whose first line is the passphrase; else FLEET_BACKUP_PASSPHRASE, else it is asked for"


@contextmanager
def errors_in_words() -> Iterator[None]:
    """Turn errors that an admin can mend into their words."""
    try:
        yield
    except (BackupError, DatabaseError, psycopg.Error, sqlite3.Error, OSError) as error:
        raise CommandError(str(error)) from error


def given_passphrase(file: Path | None) -> str | None:
    """Return the passphrase of a file or of the settings; None: neither has one."""
    if file is None:
        return settings.FLEET_BACKUP_PASSPHRASE or None
    lines = file.read_text().splitlines()
    if not lines or not lines[0].strip():
        raise CommandError(f"{file} has no passphrase in its first line.")
    return lines[0].strip()


def asked_passphrase(*, twice: bool) -> str:
    """Ask for the passphrase in the terminal."""
    if not sys.stdin.isatty():
        raise CommandError("No passphrase: give --passphrase-file, or set FLEET_BACKUP_PASSPHRASE.")
    typed = getpass.getpass("Passphrase: ")
    if not typed or (twice and getpass.getpass("The same again: ") != typed):
        raise CommandError("The passphrase is empty, or the two differ.")
    return typed


def recorded(kind: str, outcome: str, parameters: dict[str, Any], private: dict[str, Any]) -> str:
    """Record what was done. Return why it could not be recorded; blank: it is on record."""
    try:
        record(kind, actor=here(), outcome=outcome, parameters=parameters, private=private)
    except (AuditUnavailable, DatabaseError) as error:
        return f"This could not be recorded: {error}"
    return ""


@contextmanager
def failure_recorded(kind: str, parameters: dict[str, Any]) -> Iterator[None]:
    """Record a failure, for the pages and metrics of the last backup."""
    try:
        yield
    except Exception as error:
        recorded(kind, FAILED, parameters, {"why": str(error)})
        raise


def words_of(checked: Checked) -> Iterator[str]:
    """Yield what a check found, in lines."""
    about = checked.manifest
    yield f"Made {about.made_at:%Y-%m-%d %H:%M} UTC on {about.host} by release {about.version}."
    if checked.missing:
        yield f"Its database lacks {checked.missing} migrations of this release: manage.py upgrade runs them."
    if checked.records is None:
        yield "Its log can be verified after them: run manage.py verify_audit."
        return
    for finding in checked.findings[:SHOWN]:
        yield str(finding)
    if len(checked.findings) > SHOWN:
        yield f"… and {len(checked.findings) - SHOWN} more."
    result = f"findings: {len(checked.findings)}" if checked.findings else "all are as written"
    yield f"Records of its log: {checked.records}; {result}."
