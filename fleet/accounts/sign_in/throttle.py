"""Limit guesses of passwords: few failures of each name from one address, and not many more from an address.

The failures are counted in the audit log, so that several web processes count together. They are counted by
digests, because names and addresses expire in the log. A network of 64 bits of IPv6 counts as one address: one
computer has all of it. An attempt counts as failed until its password is found right, so parallel guesses gain nothing.
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
from fleet.base.web.network_addresses import network_of

FAILURES = 10  # with one name from one address
FAILURES_OF_ADDRESS = 50  # with all names from one address: a whole lab may share an address
WINDOW = timedelta(minutes=5)
# The largest difference between the clocks of two web processes. Records of a later time do not count: they
# were made while a clock was ahead.
CLOCKS_DIFFER = timedelta(minutes=5)
ATTEMPT_LASTS = timedelta(minutes=1)  # an older attempt belongs to a process that died
KIND = "account.sign_in_failed"


def failure_recorded(*, username: str, address: str, person: User | None = None) -> None:
    """Record a failed sign-in.

    `person`: set if the password was right and the code wrong (`second_factor_of`).

    The typed name is stored only if there is such an account: people sometimes type a password into the wrong
    field.
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
            "address_digest": _digest(network_of(address)),
        },
        private={
            "username": (person.username if person else username) if known else None,
            "address": address,
        },
    )


def second_factor_of(person: User) -> str:
    """Return the text that stands for name and address when a person's wrong codes are counted."""
    return f"second factor of {person.pk}"


class TooMany(Exception):
    """The password may not be checked for `wait_s` seconds; 0 while other attempts are being checked."""

    def __init__(self, wait_s: float) -> None:
        super().__init__(wait_s)
        self.wait_s = wait_s


def words(wait_s: float) -> str:
    """Return the message about how long to wait, after `TooMany`."""
    minutes = max(1, ceil(wait_s / 60))
    return ngettext(
        "Too many failed attempts for this name, or from this address. Try again in %(minutes)d minute.",
        "Too many failed attempts for this name, or from this address. Try again in %(minutes)d minutes.",
        minutes,
    ) % {"minutes": minutes}


@contextmanager
def attempt(*, username: str, address: str) -> Iterator[None]:
    """Check a password inside this context.

    Raises `TooMany` first if this name or address has too many failures.
    """
    begun = _begin(_digest(username), _digest(network_of(address)))
    try:
        yield
    finally:  # a failure is on record by now
        begun.delete()


def password_fits(person: User, password: str, *, address: str) -> bool:
    """Return whether this is the signed-in person's password.

    A wrong one counts like one on the sign-in page.

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
    """Count an attempt, or raise `TooMany`. Attempts from one address are decided one after the other."""
    if connection.vendor == "postgresql":  # SQLite needs no lock: it has one writer at a time
        with connection.cursor() as cursor:
            cursor.execute("SELECT pg_advisory_xact_lock(hashtext(%s))", [address])
    now = timezone.now()
    SignInAttempt.objects.filter(at__lt=now - ATTEMPT_LASTS).delete()
    recent = Record.objects.filter(kind=KIND, at__gt=now - WINDOW, at__lt=now + CLOCKS_DIFFER)
    failures = recent.filter(parameters__address_digest=address)
    being_checked = SignInAttempt.objects.filter(address_digest=address)
    of_name = failures.filter(parameters__name_digest=name), being_checked.filter(name_digest=name), FAILURES
    of_address = failures, being_checked, FAILURES_OF_ADDRESS
    wait_s = max(_wait_s(failed, most, now) for failed, _, most in (of_name, of_address))
    if wait_s > 0:
        raise TooMany(wait_s)
    if any(
        failed[:most].count() + pending.count() >= most for failed, pending, most in (of_name, of_address)
    ):
        raise TooMany(0)
    return SignInAttempt.objects.create(at=now, name_digest=name, address_digest=address)


def _wait_s(failures: QuerySet[Record], most: int, now: datetime) -> float:
    """Return the seconds until fewer than `most` of these failures count."""
    oldest_that_counts = failures.order_by("-at").values_list("at", flat=True)[most - 1 : most].first()
    return (oldest_that_counts + WINDOW - now).total_seconds() if oldest_that_counts else 0.0


def _digest(text: str) -> str:
    return salted_hmac("fleet.accounts.throttle", text, algorithm="sha256").hexdigest()[:32]
