"""The list of recordings, by the filters that pages and programs use."""

from __future__ import annotations

import json
from collections.abc import Sequence
from datetime import datetime

from django.db import connection
from django.db.models import Q, QuerySet
from msgspec import Struct

from fleet.accounts.models import User
from robots.access.who_sees import Reader
from robots.recordings.models import Recording
from teleop.recordings.selectors import Sight, recordings_of, sights_of, told_to


class Filters(Struct, frozen=True):
    """The values that are searched. Empty: everything."""

    robot: str = ""  # slug
    person: str = ""  # user name, or part of a name
    course: str = ""  # slug
    kind: str = ""
    event: str = ""
    topic: str = ""
    begin: datetime | None = None
    end: datetime | None = None
    words: str = ""  # in reason, robot and person


def filtered(user: User, reader: Reader, filters: Filters) -> QuerySet[Recording]:
    """Return those that match of which a person sees a part, the newest first. Nobody finds what they are not told."""
    found, told = recordings_of(user, reader), told_to(user, reader)
    for field, value in (("robot__slug", filters.robot), ("course", filters.course), ("kind", filters.kind)):
        if value:
            found = found.filter(**{field: value})
    if filters.person:
        found = found.filter(
            told & (Q(person__username=filters.person) | Q(person__full_name__icontains=filters.person))
        )
    if filters.begin:
        found = found.filter(ends_at__gt=filters.begin)
    if filters.end:
        found = found.filter(begins_at__lt=filters.end)
    if filters.event:
        found = found.filter(has("events", "event", filters.event))
    if filters.topic:
        found = found.filter(has("topics", "topic", filters.topic))
    for word in filters.words.split()[:5]:
        found = found.filter(
            Q(robot__name__icontains=word)
            | told & (Q(reason__icontains=word) | Q(person__full_name__icontains=word))
        )
    return found


def seen(user: User, recordings: Sequence[Recording], reader: Reader, event: str = "") -> list[Sight]:
    """Return what a person sees of these; `event`: only those in which they see such an event.

    The query finds it in the whole recording, of which the person may see another part.
    """
    sights = [sight for sight in sights_of(user, recordings, reader) if sight]
    return [sight for sight in sights if not event or any(one["event"] == event for one in sight.events)]


def has(field: str, name: str, value: str) -> Q:
    """Return the condition that one entry of a JSON list has this value. SQLite compares the text that it stores."""
    if connection.vendor == "sqlite":
        return Q(**{f"{field}__icontains": f"{json.dumps(name)}: {json.dumps(value)}"})
    return Q(**{f"{field}__contains": [{name: value}]})
