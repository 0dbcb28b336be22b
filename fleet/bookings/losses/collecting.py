"""Collect what a change takes from people while it is made.

Outside of `collecting`, as when a rule of the single sign-on takes a role, each person gets a letter at once.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from datetime import datetime
from typing import Any
from uuid import UUID

from django.db.models import TextChoices
from django.utils.translation import gettext_lazy as _
from msgspec import Struct, field

from fleet.accounts.models import User
from fleet.audit.command_line import SystemAccount
from fleet.bookings.messages.notifications import Words, changed_by_another
from fleet.bookings.models import Booking, Turn
from fleet.bookings.services import TIMES


class How(TextChoices):
    """The effect of a change on a booking."""

    CANCELLED = "cancelled", _("cancelled")
    ENDED = "ended", _("ended")
    SHORTENED = "shortened", _("shortened")
    TURN = "turn", _("skipped in the line")
    USELESS = "useless", _("the robot is out of service")  # the booking stays
    CLOSED = (
        "closed",
        _("outside of the opening hours"),
    )  # the booking stays, if whoever changes them wants it


Actor = User | SystemAccount


class Loss(Struct):
    """A booking of which a person loses something."""

    booking: Booking
    how: How
    before: dict[str, Any]  # `TIMES` before the change
    why: Words = str  # in the language that is active when it is called
    turn: Turn | None = None  # of a line: the loss of this person alone

    @property
    def person(self) -> User:
        """Return whose loss it is."""
        return self.turn.person if self.turn else self.booking.person


class Collected(Struct):
    """The losses of one change."""

    actor: Actor
    now: datetime
    losses: list[Loss] = field(default_factory=list)
    people: set[UUID] | None = field(default_factory=set)  # whose rights changed; None: anybody's
    for_good: bool = False  # the change cannot be undone
    came_back: list[Booking] = field(default_factory=list)
    stay_lost: list[Booking] = field(default_factory=list)

    def rights_changed(self, people: Collection[UUID] | None) -> None:
        """Note whose bookings are to be looked at when the change is complete."""
        self.people = None if people is None or self.people is None else self.people | set(people)


_now: ContextVar[Collected | None] = ContextVar("losses", default=None)


def collected() -> Collected | None:
    """Return what the change that is being made has collected so far; None: nobody collects."""
    return _now.get()


@contextmanager
def collecting(actor: Actor, now: datetime) -> Iterator[Collected]:
    """Collect the losses of the changes that are made inside."""
    found = Collected(actor, now)
    token = _now.set(found)
    try:
        yield found
    finally:
        _now.reset(token)


def lost(
    booking: Booking,
    how: How,
    now: datetime,
    *,
    before: dict[str, Any],
    actor: User | None = None,
    why: Words = str,
    turn: Turn | None = None,
) -> None:
    """Note that the person of a booking loses something. If nobody collects, write the letter now."""
    if (found := _now.get()) is not None:
        found.losses.append(Loss(booking, how, before, why, turn))
    else:
        changed_by_another(booking, actor, lambda: str(how.label), now, why)


def kept_of(booking: Booking) -> dict[str, Any]:
    """Return the fields of a booking that a loss may change."""
    return {name: getattr(booking, name) for name in TIMES}
