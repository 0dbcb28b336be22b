"""Services that are called and parameters that are set: by staff, from the allow-list, on record first."""

from __future__ import annotations

import logging
from typing import Any

import msgspec
from django.db import DatabaseError
from msgspec import Struct

from fleet import audit
from fleet.accounts.models import User
from fleet.audit.canonical import TEXT_BYTES
from fleet.audit.models import Record
from robots import wire
from robots.link.client import LinkRefused
from robots.registry.models import Role
from robots.wire import CallService, Refusal, SetParameter
from teleop.background.database import in_database
from teleop.background.tasks import run_in_background
from teleop.control.selectors import lease_of
from teleop.control.services import ControlRefused, recorded_change
from teleop.control.status import Rights
from teleop.live.robot_hub import RobotHub
from teleop.live.tasks import check_role, required_role

log = logging.getLogger(__name__)

Call = CallService | SetParameter

_STAFF_ONLY = Refusal("role_too_low", "Only staff call services and set parameters.", "account")


async def execute(call: Call, *, hub: RobotHub, user: User, rights: Rights) -> str:
    """Have it done. Returns the robot's answer, encoded; raises ControlRefused or LinkRefused."""
    refusal = _why_not(call, hub, rights)
    if refusal is not None:
        raise ControlRefused(refusal)
    begun = await in_database(_record, call, hub, user)
    try:
        answer = await hub.link.ask(call)
    except LinkRefused as refused:
        run_in_background(in_database(_record_outcome, begun, user, refused.refusal))
        raise
    run_in_background(in_database(_record_outcome, begun, user, _answered.decode(answer).refusal))
    return answer


def _why_not(call: Call, hub: RobotHub, rights: Rights) -> Refusal | None:
    if rights.role != Role.STAFF:
        return _STAFF_ONLY
    if isinstance(call, CallService):
        return check_role(rights, required_role(hub.entry.allowed, "call", call.service), call.service)
    return check_role(rights, required_role(hub.entry.allowed, "set", call.name), call.name)


def _record(call: Call, hub: RobotHub, user: User) -> Record:
    if isinstance(call, CallService):
        kind, facts, given = "service.call", {"service": call.service}, {"fields": _recorded(call.fields)}
    else:
        kind, facts, given = "parameter.set", {"name": call.name}, {"value": _recorded(call.value)}
    with recorded_change():
        held = lease_of(hub.robot_id)  # staff may call while somebody else has control
        own = held if held and held.user == user.pk else None
        return audit.record(
            kind,
            actor=user,
            robot_id=hub.robot_id,
            robot_name=hub.entry.facts.name,
            session_id=own.session if own else None,
            fence=own.fence if own else None,
            parameters=facts,
            private=given,
        )


def _record_outcome(begun: Record, user: User, refusal: Refusal | None) -> None:
    outcome, words = (refusal.code, {"words": refusal.text}) if refusal else ("done", {})
    try:
        audit.record(begun.kind, actor=user, of=begun, outcome=outcome, private=words)
    except (audit.AuditUnavailable, DatabaseError) as error:
        log.error("the outcome %s of record %s was not recorded: %s", outcome, begun.pk, error)


def _recorded(given: Any) -> Any:
    """What was given; if it is long its text, of which the log takes the beginning."""
    text = msgspec.json.encode(given)
    return given if len(text) <= TEXT_BYTES else text.decode()


class _Answered(Struct):
    """What matters here of a `wire.TopicAnswer`."""

    refusal: wire.Refusal | None = None


_answered = msgspec.json.Decoder(_Answered)
