"""Signals that report changes of access to other apps."""

from __future__ import annotations

from collections.abc import Iterable
from uuid import UUID

from django.db import transaction
from django.dispatch import Signal

# `people`: a frozenset of their identifiers, None for everybody; sent after the commit
access_changed = Signal()


def publish_access_changed(people: Iterable[UUID] | None) -> None:
    """Send `access_changed` once the transaction is committed."""
    chosen = None if people is None else frozenset(people)
    transaction.on_commit(lambda: access_changed.send(sender=Signal, people=chosen))
