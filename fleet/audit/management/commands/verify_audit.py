"""``manage.py verify_audit``: verify that the log is unchanged, and write its heads, to be kept elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO
from uuid import UUID

import msgspec
from django.core.management.base import BaseCommand, CommandError, CommandParser
from django.db import DatabaseError

from fleet.audit import services as audit
from fleet.audit.command_line import here
from fleet.audit.errors import AuditUnavailable
from fleet.audit.integrity.verify import Head, Verified, compare, verify_all, verify_one
from fleet.audit.models import Chain

SHOWN = 50  # findings; later ones often follow from the first ones

_line = msgspec.json.Decoder(Head)


class Command(BaseCommand):
    help = (
        "Verifies the audit log (tamper-evident): every record, or those of one robot. Status 1 on a finding."
    )

    def add_arguments(self, parser: CommandParser) -> None:
        parser.add_argument(
            "--robot",
            metavar="NAME",
            help="only this robot's records, by its name or identifier, and those without robot",
        )
        parser.add_argument(
            "--heads", metavar="FILE", help="write the last record of each chain there; - is stdout"
        )
        parser.add_argument("--against", metavar="FILE", help="compare with heads kept earlier; - is stdin")

    def handle(self, *args: Any, robot: str | None, heads: str | None, against: str | None, **_: Any) -> None:
        """Verify, print the findings, and record the verification."""
        kept = _read(against) if against else []
        result = verify_one(_chain(robot)) if robot else verify_all()
        result.findings += compare(kept)
        if heads:
            _write(heads, result.heads)
        self._print(result, self.stderr if heads == "-" or result.findings else self.stdout)
        self._record(result, robot)
        if result.findings:
            sys.exit(1)

    def _print(self, result: Verified, out: Any) -> None:
        for finding in result.findings[:SHOWN]:
            out.write(str(finding))
        if len(result.findings) > SHOWN:
            out.write(f"… and {len(result.findings) - SHOWN} more.")
        seen = f"Chains: {len(result.heads)}, records: {result.records}"
        out.write(
            f"{seen}, findings: {len(result.findings)}."
            if result.findings
            else f"{seen}. All are as written."
        )

    def _record(self, result: Verified, robot: str | None) -> None:
        outcome = "findings" if result.findings else "intact"
        parameters = {
            "records": result.records,
            "chains": len(result.heads),
            "findings": len(result.findings),
        }
        private = {"first": [str(finding) for finding in result.findings[:SHOWN]], "robot": robot}
        try:
            audit.record(
                "audit.verify", actor=here(), outcome=outcome, parameters=parameters, private=private
            )
        except (AuditUnavailable, DatabaseError) as error:  # such as a database user who may only read
            self.stderr.write(f"The verification could not be recorded: {error}")


def _chain(robot: str) -> Chain:
    """Return the chain of a robot, by its name or identifier."""
    try:
        chains = list(Chain.objects.filter(pk=UUID(robot)))
    except ValueError:
        chains = list(Chain.objects.filter(name=robot))
    if len(chains) != 1:
        raise CommandError(
            f"{len(chains)} robots with records are called {robot}: name one by its identifier."
        )
    return chains[0]


def _read(name: str) -> list[Head]:
    try:
        with _opened(name, "r") as file:
            return [_line.decode(line) for line in file if line.strip()]
    except (OSError, msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise CommandError(f"{name} cannot be read as heads: {error}") from error


def _write(name: str, heads: list[Head]) -> None:
    try:
        with _opened(name, "w") as file:
            file.writelines(msgspec.json.encode(head).decode() + "\n" for head in heads)
    except OSError as error:
        raise CommandError(f"The heads cannot be written to {name}: {error}") from error


@contextmanager
def _opened(name: str, mode: str) -> Iterator[TextIO]:
    if name == "-":
        yield sys.stdin if mode == "r" else sys.stdout
        return
    with Path(name).open(mode, encoding="utf-8") as file:
        yield file  # type: ignore[misc]  # in text mode
