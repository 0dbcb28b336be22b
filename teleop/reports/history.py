"""The history of a robot's speech, read from the audit log."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from django.db.models import QuerySet
from msgspec import Meta, Struct

from fleet.accounts.models import User
from fleet.audit.models import Record
from robots.access.selectors import supervises
from robots.registry.models import Robot


class SpokenText(Struct, frozen=True):
    """One text that a person had a robot speak."""

    number: int  # of its record
    text: str
    language: str
    topic: str
    who: str
    at: Annotated[datetime, Meta(tz=True)]
    outcome: str | None  # as `robots.wire.SpeechEnd`; None: not known yet
    why: str


class SpeechHistory(Struct, frozen=True):
    """A page of the history, newest first."""

    entries: list[SpokenText]
    more: bool


def speech_history(robot: Robot, user: User, *, before: int, limit: int) -> SpeechHistory:
    """Return at most `limit` texts with numbers below `before`: supervisors of the robot get all, others their own."""
    found = list(_starts(robot, user).filter(pk__lt=before).order_by("-pk")[: limit + 1])
    shown = found[:limit]
    ends = {
        end.of_id: end
        for end in Record.objects.filter(kind="speech.end", of__in=shown).select_related("content")
    }
    return SpeechHistory(
        [_spoken_text(start, ends.get(start.pk)) for start in shown], more=len(found) > limit
    )


def _starts(robot: Robot, user: User) -> QuerySet[Record]:
    starts = Record.objects.filter(kind="speech.start", robot_id=robot.id).select_related("actor", "content")
    return starts if supervises(user, robot) else starts.filter(actor_id=str(user.pk))


def _spoken_text(start: Record, end: Record | None) -> SpokenText:
    details = start.details
    return SpokenText(
        number=start.pk,
        text=details.get("text", ""),  # "": the text has expired
        language=details["language"],
        topic=details["topic"],
        who=start.actor_name,
        at=start.at,
        outcome=end.outcome if end else None,
        why=end.details.get("words", "") if end else "",
    )
