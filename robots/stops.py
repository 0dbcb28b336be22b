"""Emergency stops on record, in one way whoever pressed; afterwards, for a stop waits for nothing."""

from __future__ import annotations

import logging
from typing import Any
from uuid import UUID

from django.db import DatabaseError

from fleet import audit
from fleet.accounts.models import User
from fleet.audit.models import Record
from robots.models import Robot
from robots.wire import Refusal, Stopped

log = logging.getLogger(__name__)


def record_press(robot_id: UUID, *, actor: User | None, parameters: dict[str, Any]) -> Record | None:
    """Record that a stop was pressed; None if that was not possible, which stops nothing."""
    try:
        name = Robot.objects.filter(pk=robot_id).values_list("name", flat=True).first()
        return audit.record(
            "stop.press", actor=actor, robot_id=robot_id, robot_name=name or "", parameters=parameters
        )
    except (audit.AuditUnavailable, DatabaseError) as error:
        by = actor.pk if actor else parameters
        log.error("a stop of robot %s by %s was sent, but not recorded: %s", robot_id, by, error)
        return None


def record_outcome(record: Record | None, *, actor: User | None, result: Stopped | Refusal) -> None:
    """Record what came of a stop or a clear."""
    if record is None:
        return
    outcome = result.code if isinstance(result, Refusal) else result.stop.state
    parameters = {"text": result.text} if isinstance(result, Refusal) else {}
    try:
        audit.record(record.kind, actor=actor, of=record, outcome=outcome, parameters=parameters)
    except audit.AuditUnavailable as error:
        log.error("the outcome %s of record %s was not recorded: %s", outcome, record.pk, error)
