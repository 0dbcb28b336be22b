"""The audit log: who did what with which robot, and the outcome. Append-only, chained by digests.

`record()` is the only way in. A robot is known here by its UUID, and nothing is imported from the apps above.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple
from uuid import UUID

from fleet.audit.errors import AuditUnavailable

if TYPE_CHECKING:
    from django.contrib.auth.models import AbstractUser

    from fleet.audit.models import Record as Record

__all__ = ["AuditUnavailable", "SystemAccount", "actor_renamed", "record"]


class SystemAccount(NamedTuple):
    """A person at the command line of this computer, who has no other name."""

    name: str


def record(
    kind: str,
    *,
    actor: AbstractUser | SystemAccount | None = None,
    real_actor: AbstractUser | SystemAccount | None = None,
    robot_id: UUID | None = None,
    robot_name: str = "",
    session_id: UUID | None = None,
    fence: int | None = None,
    request_id: UUID | None = None,
    of: Record | int | None = None,
    outcome: str = "",
    parameters: dict[str, Any] | None = None,
    text: str = "",
    private: dict[str, Any] | None = None,
) -> Record:
    """Append one record. It is committed on return, or with the transaction around the call.

    `kind` stands in `fleet.audit.kinds`. `actor` None means the console itself; `real_actor` is who really did it,
    where that is somebody else. `session_id` is the control session, `fence` the fencing number of its lease. `of` is
    the earlier record whose outcome this is; robot, session, fence and request are taken over from it unless given.

    `parameters` stay for ever: plain facts, persons by their identifier, no free text. `text` is what a person wrote
    or a robot said; it can be searched. `private` has the other details. Both expire, and go when a person is erased.
    Of a text of more than 4 KiB the beginning is kept, and how long it was.

    Raises `AuditUnavailable` when the database cannot be written: what was to be recorded must not be done then.
    `ValueError` for an unknown kind or what is no JSON.
    """
    from fleet.audit.services import write  # models cannot be imported before the apps are ready

    return write(
        kind,
        actor=actor,
        real_actor=real_actor,
        robot_id=robot_id,
        robot_name=robot_name,
        session_id=session_id,
        fence=fence,
        request_id=request_id,
        of=of,
        outcome=outcome,
        parameters=parameters or {},
        text=text,
        private=private or {},
    )


def actor_renamed(person: AbstractUser) -> None:
    """Show a person's records under the name that they have now. Raises `AuditUnavailable`."""
    from fleet.audit.services import rename_actor

    rename_actor(person)
