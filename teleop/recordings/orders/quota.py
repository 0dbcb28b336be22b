"""How much one person, and one robot, may have recorded before some of it must be deleted."""

from __future__ import annotations

from uuid import UUID

from django.conf import settings
from django.db.models import Sum

from fleet.accounts.models import User
from robots.recordings.models import Kind, Place, Recording
from robots.shared.sentences import say
from robots.shared.wire import NotDone, Refusal


def check_quota(robot_id: UUID, person: User | None) -> None:
    """Refuse a new recording without room. `person` asks for it by hand; None: a booking does. Raises `NotDone`.

    Black boxes do not count: the oldest give way by themselves.
    """
    most = settings.FLEET_RECORDINGS_PERSON_BYTES
    if person is not None and (used := _used(person=person, kind=Kind.BY_HAND)) >= most:
        text = say(
            "Your recordings take {used:.1f} GB of the {most:.1f} GB that one person may have: delete some first.",
            used=used / 1e9,
            most=most / 1e9,
        )
        raise NotDone(Refusal("person_quota", text, "limits", {"used_bytes": used, "quota_bytes": most}))
    most = settings.FLEET_RECORDINGS_ROBOT_BYTES
    if (used := _used(robot=robot_id, kind__in=[Kind.BY_HAND, Kind.BOOKING])) >= most:
        text = say(
            "The recordings of this robot take {used:.1f} GB of the {most:.1f} GB that they may have: "
            "its supervisors can delete some.",
            used=used / 1e9,
            most=most / 1e9,
        )
        raise NotDone(Refusal("robot_quota", text, "limits", {"used_bytes": used, "quota_bytes": most}))


def _used(**which: object) -> int:
    rows = Recording.objects.filter(**which).exclude(place=Place.GONE)
    return rows.aggregate(bytes=Sum("bytes"))["bytes"] or 0
