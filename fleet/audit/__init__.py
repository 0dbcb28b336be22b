"""Who did what with which robot, and what came of it: one append-only table.

`record()` is the only way in. A robot is known here by its UUID, and nothing is imported from the apps above.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from uuid import UUID

from fleet.audit.errors import AuditUnavailable

if TYPE_CHECKING:
    from django.contrib.auth.models import AbstractUser

    from fleet.audit.models import Record as Record

__all__ = ["AuditUnavailable", "record"]


def record(
    kind: str,
    *,
    actor: AbstractUser | None = None,
    robot_id: UUID | None = None,
    robot_name: str = "",
    session_id: UUID | None = None,
    fence: int | None = None,
    request_id: UUID | None = None,
    of: Record | int | None = None,
    outcome: str = "",
    parameters: dict[str, Any] | None = None,
) -> Record:
    """Write one record. It is committed on return, or with the transaction around the call.

    `actor` None means the console itself. `session_id` is the control session, `fence` the fencing number of its lease.
    `of` is the earlier record whose outcome this is; its request id is taken over unless one is given.

    Raises `AuditUnavailable` when the database cannot be written: what was to be recorded must not be done then.
    """
    from fleet.audit.services import write  # models cannot be imported before the apps are ready

    return write(
        kind,
        actor=actor,
        robot_id=robot_id,
        robot_name=robot_name,
        session_id=session_id,
        fence=fence,
        request_id=request_id,
        of=of,
        outcome=outcome,
        parameters=parameters or {},
    )
