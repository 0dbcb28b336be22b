"""Service calls and parameter changes: for staff in control, from the allow-list, recorded before they are sent."""

from __future__ import annotations

import logging
from typing import Any

import msgspec
from django.db import DatabaseError
from django.utils import timezone
from msgspec import Struct

from fleet.accounts.models import User
from fleet.audit import services as audit
from fleet.audit.errors import AuditUnavailable
from fleet.audit.integrity.canonical import TEXT_BYTES
from fleet.audit.models import Record
from robots.link.client import LinkRefused
from robots.registry.models import Role
from robots.shared import wire
from robots.shared.wire import CallService, DeleteParameter, Refusal, SetParameter
from teleop.background.database import in_database
from teleop.background.jobs import run_in_background
from teleop.control.allowed.allow_list import check_role, required_role
from teleop.control.changes import ControlRefused, recorded_change, robot_locked
from teleop.control.lease_checks import check_in_control
from teleop.control.selectors import lease_of
from teleop.control.status import Rights
from teleop.live.robot_hub import RobotHub

log = logging.getLogger(__name__)

ServiceCall = CallService | SetParameter | DeleteParameter

_STAFF_ONLY = Refusal("role_too_low", "Only staff may call services and set parameters.", "account")


async def execute(call: ServiceCall, *, hub: RobotHub, user: User, rights: Rights) -> str:
    """Check, record and send a call. Returns the robot's encoded answer. Raises ControlRefused or LinkRefused."""
    refusal = _check(call, hub, rights)
    if refusal is not None:
        raise ControlRefused(refusal)
    begun = await in_database(_record, call, hub, user)
    try:
        answer = await hub.link.query_topics(call, person=user.pk)
    except LinkRefused as refused:
        run_in_background(in_database(_record_outcome, begun, user, refused.refusal))
        raise
    run_in_background(in_database(_record_outcome, begun, user, _answered.decode(answer).refusal))
    return answer


def _check(call: ServiceCall, hub: RobotHub, rights: Rights) -> Refusal | None:
    if rights.role != Role.STAFF:
        return _STAFF_ONLY
    if isinstance(call, CallService):
        return check_role(rights, required_role(hub.entry.allowed, "call", call.service), call.service)
    return check_role(rights, required_role(hub.entry.allowed, "set", call.name), call.name)


def _record(call: ServiceCall, hub: RobotHub, user: User) -> Record:
    if isinstance(call, CallService):
        kind, facts, given = "service.call", {"service": call.service}, {"fields": _recorded(call.fields)}
    elif isinstance(call, SetParameter):
        kind, facts, given = "parameter.set", {"name": call.name}, {"value": _recorded(call.value)}
    else:
        kind, facts, given = "parameter.delete", {"name": call.name}, {}
    with recorded_change():
        robot_locked(hub.robot_id)  # control cannot change until the call is on record
        held = lease_of(hub.robot_id)
        refusal = check_in_control(held, user=user.pk, now=timezone.now())
        if refusal is not None:
            raise ControlRefused(refusal)
        return audit.record(
            kind,
            actor=user,
            robot_id=hub.robot_id,
            robot_name=hub.entry.facts.name,
            session_id=held.session if held else None,
            fence=held.fence if held else None,
            parameters=facts,
            private=given,
        )


def _record_outcome(begun: Record, user: User, refusal: Refusal | None) -> None:
    outcome, words = (refusal.code, {"words": refusal.sentence}) if refusal else ("done", {})
    try:
        audit.record(begun.kind, actor=user, of=begun, outcome=outcome, private=words)
    except (AuditUnavailable, DatabaseError) as error:
        log.error("The outcome %s of record %s was not recorded: %s", outcome, begun.pk, error)


def _recorded(given: Any) -> Any:
    """Return the value for the record; a long value as text, because the log cuts long text."""
    text = msgspec.json.encode(given)
    return given if len(text) <= TEXT_BYTES else text.decode()


class _Answered(Struct):
    """The field of a `wire.TopicAnswer` that this module reads."""

    refusal: wire.Refusal | None = None


_answered = msgspec.json.Decoder(_Answered)
