"""Guessing passwords is slow: few failures for each name from each address, and not many more from one address.

The failures are counted in the audit log, so that several web processes count together; by digests, for names and
addresses do not stay there for ever.
"""

from __future__ import annotations

from datetime import datetime, timedelta

from django.db.models import QuerySet
from django.utils import timezone
from django.utils.crypto import salted_hmac

from fleet.accounts.models import User
from fleet.audit import record
from fleet.audit.models import Record

FAILURES = 10  # of one name from one address
FAILURES_OF_ADDRESS = 50  # of all names: a whole lab may sit behind one address
WINDOW = timedelta(minutes=5)
# of two web processes: what is later was recorded while a clock was ahead, and counts no more
CLOCKS = timedelta(minutes=5)
KIND = "account.sign_in_failed"


def failure_recorded(*, username: str, address: str) -> None:
    """Put a failed sign-in on record.

    The name is kept as it was typed only if there is such an account: people type passwords into the wrong field.
    """
    known = User.objects.filter(username=username).values_list("pk", flat=True).first()
    record(
        KIND,
        outcome="refused",
        parameters={
            "user": str(known) if known else None,
            "name_digest": _digest(username),
            "address_digest": _digest(address),
        },
        private={"username": username if known else None, "address": address},
    )


def wait_s(*, username: str, address: str) -> float:
    """Seconds until this name may be tried again from this address; 0 if it may be now."""
    now = timezone.now()
    recent = Record.objects.filter(kind=KIND, at__gt=now - WINDOW, at__lt=now + CLOCKS)
    from_there = recent.filter(parameters__address_digest=_digest(address))
    of_name = from_there.filter(parameters__name_digest=_digest(username))
    return max(_wait_s(of_name, FAILURES, now), _wait_s(from_there, FAILURES_OF_ADDRESS, now))


def _wait_s(failures: QuerySet[Record], most: int, now: datetime) -> float:
    """Seconds until fewer than `most` of these failures count."""
    oldest_that_counts = failures.order_by("-at").values_list("at", flat=True)[most - 1 : most].first()
    return (oldest_that_counts + WINDOW - now).total_seconds() if oldest_that_counts else 0.0


def _digest(text: str) -> str:
    return salted_hmac("fleet.accounts.throttle", text, algorithm="sha256").hexdigest()[:32]
