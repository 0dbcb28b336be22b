"""The history of a robot's speech, read from the audit log."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any
from uuid import UUID

import msgspec
from msgspec import Meta, Struct

from fleet.base.database import rows


class SpokenText(Struct, frozen=True):
    """One text that a person had a robot speak."""

    number: int  # of its record
    text: str
    language: str
    topic: str
    who: str
    at: Annotated[datetime, Meta(tz=True)]
    outcome: str | None  # as `robots.shared.wire.SpeechEnd`; None: not known yet
    why: str


class SpeechHistory(Struct, frozen=True):
    """A page of the history, newest first."""

    entries: list[SpokenText]
    more: bool


_STARTS = """
SELECT r.id, r.at, r.parameters, a.name, c.text, c.data
FROM audit_record r LEFT JOIN audit_actor a ON a.id = r.actor_id LEFT JOIN audit_content c ON c.record_id = r.id
WHERE r.kind = 'speech.start' AND r.robot_id = %s AND r.id < %s {by_person} ORDER BY r.id DESC LIMIT %s
"""
_ENDS = """
SELECT r.of_id, r.outcome, r.parameters, c.data
FROM audit_record r LEFT JOIN audit_content c ON c.record_id = r.id
WHERE r.kind = 'speech.end' AND r.of_id IN ({starts}) ORDER BY r.id DESC
"""


def speech_history(robot_id: UUID, person_id: UUID | None, *, before: int, limit: int) -> SpeechHistory:
    """Return at most `limit` texts with numbers below `before` that a person (None: anybody) had the robot speak.

    The queries are hand-written SQL, because programs with dashboards poll this history.
    """
    by_person = "" if person_id is None else "AND r.actor_id = %s"
    people = [] if person_id is None else [str(person_id)]
    found = rows.read(_STARTS.format(by_person=by_person), [robot_id, before, *people, limit + 1])
    shown = found[:limit]
    numbers = [number for number, *_ in shown]
    ends = rows.read(_ENDS.format(starts=rows.marks(numbers)), numbers) if numbers else []
    ended = {of: (outcome, _details(*stored).get("words", "")) for of, outcome, *stored in ends}
    entries = []
    for number, at, parameters, who, text, data in shown:
        details = _details(parameters, data)
        outcome, why = ended.get(number, (None, ""))
        entries.append(
            SpokenText(
                number=number,
                text=text or "",  # "": the text has expired
                language=details["language"],
                topic=details["topic"],
                who=who or "",
                at=rows.moment(at),
                outcome=outcome,
                why=why,
            )
        )
    return SpeechHistory(entries, more=len(found) > limit)


def _details(parameters: str, data: str | None) -> dict[str, Any]:
    """Return a record's parameters together with the details that have not expired; its text is not included."""
    found: dict[str, Any] = msgspec.json.decode(parameters) | msgspec.json.decode(data or "{}")
    return found
