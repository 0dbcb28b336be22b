"""Records refusals: requests of people that were not carried out, from any interface, with their figures.

A separate thread writes them, so that no answer waits for the database. Repeated refusals (same person,
robot, control session and code) share records: the first refusal is recorded at once; more refusals within
`GAP_S` share one record with their number `times`. If the person's record budget is used up, records wait.
"""

from __future__ import annotations

import atexit
import logging
from typing import Any, NamedTuple
from uuid import UUID

from django.db import DatabaseError, close_old_connections

from fleet.accounts.models import User
from fleet.audit import services as audit
from fleet.audit.errors import AuditUnavailable
from robots.shared.wire import Refusal
from teleop.records.repeat_suppression import RepeatSuppressor

logger = logging.getLogger(__name__)

GAP_S = 10.0
PACING_GAP_S = 600.0
# Codes of messages that were refused because of their timing, not their content.
PACING = frozenset({"too_old", "out_of_order", "flood", "busy"})

Key = tuple[UUID, UUID | None, UUID | None, str]


class RefusedRequest(NamedTuple):
    """A request of a person that was refused."""

    person: User
    through: str  # interface: robot page, fleet page, topics, rest
    of: str  # kind of message, or method and address
    refusal: Refusal
    robot_id: UUID | None = None
    robot_name: str = ""
    session_id: UUID | None = None  # the person's control session of this robot, if any
    fence: int | None = None

    @property
    def deferrable(self) -> bool:
        """True: nothing was done, so the record is not urgent."""
        return True

    @property
    def key(self) -> Key:
        """Refusals with the same key are repeats."""
        return self.person.pk, self.robot_id, self.session_id, self.refusal.code

    @property
    def gap_s(self) -> float:
        """Seconds between two records of repeats."""
        return PACING_GAP_S if self.refusal.code in PACING else GAP_S


def write_record(refused: RefusedRequest, times: int) -> None:
    """Write one record of a request that was refused `times` times. A failure is only logged; the person sees no error.

    Figures that are text may contain names or typed text, so they expire; numbers stay.
    """
    refusal = refused.refusal
    numbers = {name: value for name, value in refusal.figures.items() if not isinstance(value, str)}
    facts: dict[str, Any] = {"rule": refusal.rule, "of": refused.of, "through": refused.through}
    if numbers:
        facts["figures"] = numbers
    if times > 1:
        facts["times"] = times
    whole = {"figures": refusal.figures} if numbers != refusal.figures else {}
    try:
        close_old_connections()
        audit.record(
            "refusal",
            actor=refused.person,
            robot_id=refused.robot_id,
            robot_name=refused.robot_name,
            session_id=refused.session_id,
            fence=refused.fence,
            outcome=refusal.code,
            parameters=facts,
            private={"words": refusal.sentence, **whole},
        )
    except (AuditUnavailable, DatabaseError) as error:
        who = refused.person.pk
        logger.error("%d refusals (%s) for %s were not recorded: %s", times, refusal.code, who, error)
    finally:
        close_old_connections()


refusal_records = RepeatSuppressor(write_record)
atexit.register(refusal_records.flush)


def record_soon(refused: RefusedRequest) -> None:
    """Record a refusal soon, in another thread."""
    refusal_records.add(refused)
