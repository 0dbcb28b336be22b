"""Refusals on record: what a person asked for and was not done, by whatever door, with the figures behind it.

A thread of its own writes them, so that no answer waits for the database. One person's refusals with one code at one
robot are folded: the first is written at once, what follows within `GAP_S` in one record with the number of `times`,
as far as the person's budget of records goes.
"""

from __future__ import annotations

import atexit
import logging
from typing import Any, NamedTuple
from uuid import UUID

from django.db import DatabaseError, close_old_connections

from fleet import audit
from fleet.accounts.models import User
from robots.wire import Refusal
from teleop.recording.repeat_suppression import RepeatSuppressor

logger = logging.getLogger(__name__)

GAP_S = 10.0
PACING_GAP_S = 600.0
PACING = frozenset({"too_old", "out_of_order", "flood", "busy"})  # not what was asked for, but when

Key = tuple[UUID, UUID | None, UUID | None, str]


class RefusedRequest(NamedTuple):
    """Something that somebody asked for and did not get."""

    person: User
    through: str  # which door
    of: str  # the kind of message, or of request
    refusal: Refusal
    robot_id: UUID | None = None
    robot_name: str = ""
    session_id: UUID | None = None  # the person's control session there, if they have control
    fence: int | None = None

    @property
    def waits(self) -> bool:
        """Nothing was done, so nothing is urgent."""
        return True

    @property
    def key(self) -> Key:
        """What is folded into one."""
        return self.person.pk, self.robot_id, self.session_id, self.refusal.code

    @property
    def gap_s(self) -> float:
        """Between two records of it."""
        return PACING_GAP_S if self.refusal.code in PACING else GAP_S


def put_on_record(denied: RefusedRequest, times: int) -> None:
    """Write one record of what was refused so many times. That it is lost is no error to the person: it is logged.

    Figures that are words may name persons, or repeat what somebody typed: they may expire, numbers stay.
    """
    refusal = denied.refusal
    numbers = {name: value for name, value in refusal.figures.items() if not isinstance(value, str)}
    facts: dict[str, Any] = {"rule": refusal.rule, "of": denied.of, "through": denied.through}
    if numbers:
        facts["figures"] = numbers
    if times > 1:
        facts["times"] = times
    whole = {"figures": refusal.figures} if numbers != refusal.figures else {}
    try:
        close_old_connections()
        audit.record(
            "refusal",
            actor=denied.person,
            robot_id=denied.robot_id,
            robot_name=denied.robot_name,
            session_id=denied.session_id,
            fence=denied.fence,
            outcome=refusal.code,
            parameters=facts,
            private={"words": refusal.text, **whole},
        )
    except (audit.AuditUnavailable, DatabaseError) as error:
        who = denied.person.pk
        logger.error("%d refusals (%s) of %s were not recorded: %s", times, refusal.code, who, error)
    finally:
        close_old_connections()


log = RepeatSuppressor(put_on_record)
atexit.register(log.flush)


def note(denied: RefusedRequest) -> None:
    """Put a refusal on record, some time soon."""
    log.note(denied)
