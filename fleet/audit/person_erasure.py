"""Erase a person: the records stay under a pseudonym, without the person's texts and names."""

from __future__ import annotations

import json
import re
import time
import unicodedata
from collections.abc import Callable, Collection, Iterator
from itertools import chain
from typing import Any

from django.contrib.auth.models import AbstractUser
from django.db import transaction
from django.db.models import Max, Q, QuerySet, TextField
from django.db.models.functions import Cast
from django.utils import timezone

from fleet.audit.command_line import SystemAccount
from fleet.audit.models import Actor, Content, Record
from fleet.audit.retention import empty_wal, take_out
from fleet.audit.services import record, wait_for_writers

PAUSE_S = 0.02  # between two steps, so that others can write


def pseudonym(person_id: str) -> str:
    """Return the name of an erased person.

    It is made from the identifier, which stays in the records anyway.
    """
    return f"Person {person_id[:4]}"


def erase(
    person_id: str,
    *,
    names: Collection[str],
    actor: AbstractUser | SystemAccount | None,
    forget: Callable[[], object],
) -> Record:
    """Erase the person with this identifier and these `names` from the log; `actor` is who does it.

    `forget` removes the names from other tables, in the transaction that records the erasure. If the call is
    interrupted before this transaction, repeat it with the names. If it is interrupted later, repeat it
    without names: the record lists the contents to remove. Verification of the chain uses this list, too:
    these contents may be missing. The caller ensures that the person does nothing more.
    """
    newest = Content.objects.aggregate(newest=Max("pk"))["newest"] or 0
    wait_for_writers()  # some of them may have numbers below the newest, and have not committed yet
    numbers = _by_or_about(person_id, names, Content.objects.filter(pk__lte=newest))
    with transaction.atomic():
        numbers |= _by_or_about(person_id, names, Content.objects.filter(pk__gt=newest))  # added since then
        erased = record(
            "audit.erase", actor=actor, parameters={"person": person_id, "records": sorted(numbers)}
        )
        Actor.objects.filter(pk=person_id, erased_at=None).update(
            name=pseudonym(person_id), erased_at=timezone.now()
        )
        forget()
    for _ in chain(take_out(_on_record(person_id)), empty_wal()):
        time.sleep(PAUSE_S)
    return erased


def _on_record(person_id: str) -> list[int]:
    """Return the numbers of all records that this person's erasures list, also interrupted erasures."""
    erasures = Record.objects.filter(kind="audit.erase", parameters__person=person_id)
    return sorted(
        {number for erased in erasures.values_list("parameters", flat=True) for number in erased["records"]}
    )


def _by_or_about(person_id: str, names: Collection[str], contents: QuerySet[Content]) -> set[int]:
    """Return the numbers of the person's contents, and of contents with the person's identifier or a name."""
    readable = contents.annotate(
        facts=Cast("record__parameters", TextField()), details=Cast("data", TextField())
    )
    about = Q(facts__contains=person_id) | Q(details__contains=person_id)
    by = Q(record__actor=person_id) | Q(record__real_actor=person_id)
    return {*readable.filter(about | by).values_list("pk", flat=True), *_naming(names, readable)}


def _naming(names: Collection[str], readable: QuerySet[Content]) -> Iterator[int]:
    """Return the numbers of contents that contain one of the names as a whole word, with the same case."""
    known = {form for name in names if name.strip() for form in (name, unicodedata.normalize("NFC", name))}
    if not known:
        return
    might = Q()
    for name in known:
        might |= Q(text__contains=name)
        for ascii_only in (True, False):  # JSON as SQLite stores it, and as PostgreSQL stores it
            might |= Q(details__contains=json.dumps(name, ensure_ascii=ascii_only)[1:-1])
    named = re.compile("|".join(rf"(?<!\w){re.escape(name)}(?!\w)" for name in known))
    for number, text, data in readable.filter(might).values_list("pk", "text", "data").iterator():
        if any(named.search(words) for words in (text, *_words(data))):
            yield number


def _words(value: Any) -> Iterator[str]:
    """Return all texts in a JSON value, also keys: the sender of a message chooses its field names."""
    match value:
        case str():
            yield value
        case dict():
            yield from _words([*value, *value.values()])
        case list():
            for item in value:
                yield from _words(item)
