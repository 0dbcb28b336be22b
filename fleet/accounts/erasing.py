"""Erase people who were chosen on a page: their accounts close at once, housekeeping erases them soon after.

What still happens may contain the name: the end of control, and refusals, which are collected for 10 s before they
are recorded. After `WAIT` it is on record and can be erased, too. Who opens an account again before cancels that.
"""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime, timedelta

from django.db import transaction
from django.db.models import Q

from fleet.accounts.models import ERASED, Erasure, User
from fleet.accounts.services import account_erase

WAIT = timedelta(seconds=75)
AGAIN = timedelta(hours=1)  # a process that had claimed it has died


def erasable(people: Iterable[User], actor: User) -> list[User]:
    """Return those whom `actor` may erase: everybody but themselves, and nobody twice."""
    return [one for one in people if one != actor and not one.username.startswith(ERASED)]


@transaction.atomic
def erasures_ask(*, people: Iterable[User], actor: User, now: datetime) -> int:
    """Close the accounts of these people, and let housekeeping erase them. Return how many."""
    chosen = erasable(people, actor)
    for person in chosen:
        if person.is_active:
            person.is_active, person.changed_by = False, actor
            person.save(update_fields=["is_active"])
        Erasure.objects.update_or_create(person=person, defaults={"asked_by": actor, "asked_at": now})
    return len(chosen)


def erase_next(now: datetime) -> bool:
    """Erase the next person. Return whether there was one. Several processes may call this."""
    free = Q(claimed_at=None) | Q(claimed_at__lt=now - AGAIN)
    due = Erasure.objects.filter(free, asked_at__lte=now - WAIT).select_related("person", "asked_by")
    if (erasure := due.order_by("asked_at").first()) is None:
        return False
    if Erasure.objects.filter(free, pk=erasure.pk).update(claimed_at=now):
        account_erase(user=erasure.person, actor=erasure.asked_by)
        erasure.delete()
    return True
