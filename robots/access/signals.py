"""Signals that report changes of access to other apps."""

from __future__ import annotations

from collections.abc import Iterable
from uuid import UUID

from django.db import transaction
from django.dispatch import Signal

# `people`: a frozenset of their identifiers, None for everybody. Sent inside the transaction, and after its commit.
access_changing = Signal()
access_changed = Signal()
course_opened = Signal()  # an archived course is opened again; argument: course. Sent inside the transaction


def publish_access_changed(people: Iterable[UUID] | None) -> None:
    """Send `access_changing` now, and `access_changed` once the transaction is committed."""
    chosen = None if people is None else frozenset(people)
    access_changing.send(sender=Signal, people=chosen)
    transaction.on_commit(lambda: access_changed.send(sender=Signal, people=chosen))
