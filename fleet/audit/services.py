"""Writing to the audit log. Callers use `fleet.audit.record`."""

from __future__ import annotations

import uuid
from typing import Any

from django.contrib.auth.models import AbstractUser
from django.db import InterfaceError, InternalError, OperationalError

from fleet.audit.errors import AuditUnavailable
from fleet.audit.models import Record


def write(
    kind: str,
    *,
    actor: AbstractUser | None,
    robot_id: uuid.UUID | None,
    robot_name: str,
    session_id: uuid.UUID | None,
    fence: int | None,
    request_id: uuid.UUID | None,
    of: Record | int | None,
    outcome: str,
    parameters: dict[str, Any],
) -> Record:
    """Insert one record, or raise `AuditUnavailable`."""
    earlier = of if isinstance(of, Record) else None
    new = Record(
        kind=kind,
        actor_id=str(actor.pk) if actor else "",
        actor_name=_name(actor),
        robot_id=robot_id or (earlier.robot_id if earlier else None),
        robot_name=robot_name or (earlier.robot_name if earlier else ""),
        session_id=session_id,
        fence=fence,
        request_id=request_id or (earlier.request_id if earlier else uuid.uuid4()),
        of_id=of.pk if isinstance(of, Record) else of,
        outcome=outcome,
        parameters=parameters,
    )
    try:
        new.save()
    except (OperationalError, InternalError, InterfaceError) as error:
        raise AuditUnavailable.because(error) from error
    return new


def _name(actor: AbstractUser | None) -> str:
    return (actor.get_full_name() or actor.get_username()) if actor else ""
