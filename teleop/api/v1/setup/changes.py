"""Changes that took time from people, and undo: for those who made them, and staff."""

from __future__ import annotations

from collections.abc import Iterable
from uuid import UUID

from django.http import Http404
from django.utils import timezone
from msgspec import Struct

from fleet.accounts.models import User
from fleet.accounts.tokens.models import Scope
from fleet.bookings.losses.undo import changes_of, undo, undo_refused
from fleet.bookings.models import Booking, Change
from robots.registry.models import Robot
from teleop.api.v1.framework.operation import reads
from teleop.api.v1.framework.parameters import Time
from teleop.api.v1.setup.base import SetupView, manages

LISTED = 50


class LostBooking(Struct, frozen=True):
    """A booking of which a change took something."""

    booking: UUID
    how: str  # cancelled, ended, shortened; turn: skipped in its line; useless: the booking stays


class ChangeEntry(Struct, frozen=True):
    """A change that took time from people. `kind`: of its record in the log; `about`: courses, robots and the like."""

    id: UUID
    kind: str
    about: str
    by: str | None
    made_at: Time
    losses: list[LostBooking]
    undone_at: Time | None
    undoable: bool


class ChangeList(Struct, frozen=True):
    """The latest of these changes, newest first."""

    changes: list[ChangeEntry]


class UndoneEntry(Struct, frozen=True):
    """The bookings that came back, and those that did not: they are over, taken by others, or changed since."""

    back: list[UUID]
    lost: list[UUID]
    entries_changed_since: int


class ChangesBase(SetupView):
    tag = "policies"

    def one(self, change_id: UUID) -> Change:
        """Return one of these changes. Raises `Http404`."""
        found = changes_of(self.person).filter(pk=change_id).first()
        if found is None or not self.serves(_robots(found)):
            raise Http404
        return found


class ChangesView(ChangesBase):
    @reads("changes_list", "List changes that took time from people", scope=Scope.MANAGE, refuses=())
    def get(self) -> ChangeList:
        """Your own; for staff all."""
        found = [one for one in changes_of(self.person)[:LISTED] if self.serves(_robots(one))]
        return ChangeList([_entry(one, self.person) for one in found])


class UndoView(ChangesBase):
    def concerned(self, change_id: UUID, **_asked: object) -> Iterable[Robot]:
        return ()  # roles and courses of the change may be about any robot: no token that is bound to some

    @manages("changes_undo", "Undo a change that took time from people", takes_time=True)
    def post(self, change_id: UUID) -> UndoneEntry:
        """Within a day. What is still free comes back, and its people get a letter."""
        done = undo(change_id=self.one(change_id).pk, actor=self.person, now=timezone.now())
        return UndoneEntry([one.pk for one in done.back], [one.pk for one in done.lost], done.entries)


def _robots(change: Change) -> list[Robot]:
    keys = [one["booking"] for one in change.losses]
    return list(Robot.objects.filter(pk__in=Booking.objects.filter(pk__in=keys).values("robot")))


def _entry(change: Change, person: User) -> ChangeEntry:
    losses = [LostBooking(UUID(one["booking"]), one["how"]) for one in change.losses]
    by = change.actor.display_name if change.actor else None
    undoable = undo_refused(change, timezone.now(), person) is None
    about = (change.pk, change.kind, change.about, by, change.made_at)
    return ChangeEntry(*about, losses, change.undone_at, undoable)
