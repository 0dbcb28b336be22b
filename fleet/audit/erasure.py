"""A person is forgotten: their records stay, under a pseudonym, without what they wrote or what names them."""

from __future__ import annotations

import time

from django.contrib.auth.models import AbstractUser
from django.db import transaction
from django.db.models import Q, TextField
from django.db.models.functions import Cast
from django.utils import timezone

from fleet.audit import SystemAccount, record
from fleet.audit.models import Actor, Content, Record
from fleet.audit.retention import take_out

PAUSE_S = 0.02  # between two steps: other writers come in


def pseudonym(person_id: str) -> str:
    """The name of somebody who was erased; by the identifier that stands in their records anyway."""
    return f"Person {person_id[:4]}"


def erase(person_id: str, *, actor: AbstractUser | SystemAccount | None) -> Record:
    """Erase the person with this identifier from the log; `actor` is who does it.

    What is to be taken out is recorded first, so that the chain's verification knows why it is gone. Whoever is
    interrupted repeats it. The caller sees to it that the person does nothing more.
    """
    numbers = _contents_by_or_about(person_id)
    with transaction.atomic():
        told = record("audit.erase", actor=actor, parameters={"person": person_id, "records": numbers})
        Actor.objects.filter(pk=person_id, erased_at=None).update(
            name=pseudonym(person_id), erased_at=timezone.now()
        )
    for _ in take_out(numbers):
        time.sleep(PAUSE_S)
    return told


def _contents_by_or_about(person_id: str) -> list[int]:
    """The numbers of records that have content, and are the person's or name their identifier."""
    by = Content.objects.filter(Q(record__actor=person_id) | Q(record__real_actor=person_id))
    about = Content.objects.annotate(
        facts=Cast("record__parameters", TextField()), details=Cast("data", TextField())
    ).filter(Q(facts__contains=person_id) | Q(details__contains=person_id))
    return sorted({*by.values_list("pk", flat=True), *about.values_list("pk", flat=True)})
