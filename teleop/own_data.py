"""What the console has of a person, as they may read it and take it along."""

from __future__ import annotations

from datetime import datetime

from msgspec import Struct

from fleet.accounts.models import User
from fleet.audit import exports
from fleet.audit.listing import Page, Selection, Wanted
from teleop.models import ControlSession

SESSIONS = 20  # of a page
RECORDS = 30


class Sessions(Struct, frozen=True):
    """Some of one's own control sessions, newest first."""

    shown: list[ControlSession]
    older: bool


def own_sessions(user: User, before: datetime | None) -> Sessions:
    """The newest, or those that began before."""
    sessions = ControlSession.objects.filter(user=user).select_related("robot").order_by("-started_at")
    if before is not None:
        sessions = sessions.filter(started_at__lt=before)
    found = list(sessions[: SESSIONS + 1])
    return Sessions(found[:SESSIONS], older=len(found) > SESSIONS)


def own_records(user: User, *, before: int | None, after: int | None) -> Page:
    """What this person did, newest first, each with what came of it."""
    return Selection(_of(user)).page(before=before, after=after, size=RECORDS)


def export_of(user: User) -> exports.ExportResponse:
    """All of that as a file. Raises `AuditUnavailable`: what cannot be recorded is not told."""
    return exports.response(
        Selection(_of(user)), _of(user), actor=user, name="your-data", format_=exports.Format.JSON_LINES
    )


def _of(user: User) -> Wanted:
    return Wanted(person=str(user.pk))
