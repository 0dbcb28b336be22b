"""Guessing passwords is slow: few failures for each name from each address, and not many more from one address.

The failures are counted in the audit log, so that several web processes count together; by digests, for names and
addresses do not stay there for ever. An attempt counts as failed until its password is found right, so
parallel guesses gain nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime, timedelta
from math import ceil

from django.core.exceptions import ValidationError
from django.db import connection, transaction
from django.db.models import QuerySet
from django.utils import timezone
from django.utils.crypto import salted_hmac
from django.utils.translation import ngettext

from fleet.accounts.models import SignInAttempt, User
from fleet.audit.models import Record
from fleet.audit.services import record

FAILURES = 10  # of one name from one address
FAILURES_OF_ADDRESS = 50  # of all names: a whole lab may sit behind one address
WINDOW = timedelta(minutes=5)
# of two web processes: later records were made while a clock was ahead, and do not count
CLOCKS = timedelta(minutes=5)
LOOKED_AT = timedelta(minutes=1)  # an attempt older than this was left behind by a process that died
KIND = "account.sign_in_failed"


def failure_recorded(*, username: str, address: str, person: User | None = None) -> None:
    """Record a failed sign-in: by password, or of a known `person` by a code, which is counted under another name.

    The name is kept as it was typed only if there is such an account: people type passwords into the wrong field.
    """
    known = (
        person.pk if person else User.objects.filter(username=username).values_list("pk", flat=True).first()
    )
    record(
        KIND,
        outcome="refused",
        parameters={
            "user": str(known) if known else None,
            "name_digest": _digest(username),
            "address_digest": _digest(address),
        },
        private={
            "username": (person.username if person else username) if known else None,
            "address": address,
        },
    )


def second_factor_of(person: User) -> str:
    """Return the name, and the address, under which a person's wrong codes are counted, from wherever they come."""
    return f"second factor of {person.pk}"


class TooMany(Exception):
    """The password may not be looked at for `wait_s` seconds; 0 while other attempts are being decided."""

    def __init__(self, wait_s: float) -> None:
        super().__init__(wait_s)
        self.wait_s = wait_s


def words(wait_s: float) -> str:
    """Tell how long to wait, after `TooMany`."""
    minutes = max(1, ceil(wait_s / 60))
    return ngettext(
        "Too many failed attempts for this name, or from this address. Try again in %(minutes)d minute.",
        "Too many failed attempts for this name, or from this address. Try again in %(minutes)d minutes.",
        minutes,
    ) % {"minutes": minutes}


@contextmanager
def attempt(*, username: str, address: str) -> Iterator[None]:
    """Look at a password in here. Raises `TooMany` before, if that name or address has had its share."""
    begun = _begin(_digest(username), _digest(address))
    try:
        yield
    finally:  # the failure is recorded by now
        begun.delete()


def password_fits(person: User, password: str, *, address: str) -> bool:
    """Return whether this is the password of a signed-in person. Wrong ones count as those at the sign-in page.

    Raises `ValidationError` while the person must wait.
    """
    try:
        with attempt(username=person.username, address=address):
            if person.check_password(password):
                return True
            failure_recorded(username=person.username, address=address)
            return False
    except TooMany as error:
        raise ValidationError(words(error.wait_s), code="throttled") from error


@transaction.atomic
def _begin(name: str, address: str) -> SignInAttempt:
    """Count an attempt, or raise `TooMany`; of those from one address one decides after the other."""
    if connection.vendor == "postgresql":  # SQLite has one writer at a time
        with connection.cursor() as cursor:
            cursor.execute("SELECT pg_advisory_xact_lock(hashtext(%s))", [address])
    now = timezone.now()
    SignInAttempt.objects.filter(at__lt=now - LOOKED_AT).delete()
    recent = Record.objects.filter(kind=KIND, at__gt=now - WINDOW, at__lt=now + CLOCKS)
    failures = recent.filter(parameters__address_digest=address)
    looked_at = SignInAttempt.objects.filter(address_digest=address)
    of_name = failures.filter(parameters__name_digest=name), looked_at.filter(name_digest=name), FAILURES
    of_address = failures, looked_at, FAILURES_OF_ADDRESS
    wait_s = max(_wait_s(failed, most, now) for failed, _, most in (of_name, of_address))
    if wait_s > 0:
        raise TooMany(wait_s)
    if any(
        failed[:most].count() + pending.count() >= most for failed, pending, most in (of_name, of_address)
    ):
        raise TooMany(0)
    return SignInAttempt.objects.create(at=now, name_digest=name, address_digest=address)


def _wait_s(failures: QuerySet[Record], most: int, now: datetime) -> float:
    """Seconds until fewer than `most` of these failures count."""
    oldest_that_counts = failures.order_by("-at").values_list("at", flat=True)[most - 1 : most].first()
    return (oldest_that_counts + WINDOW - now).total_seconds() if oldest_that_counts else 0.0


def _digest(text: str) -> str:
    return salted_hmac("fleet.accounts.throttle", text, algorithm="sha256").hexdigest()[:32]
