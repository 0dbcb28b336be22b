"""Records of the audit log as events: which records are events, and the JSON that is sent."""

from __future__ import annotations

import json
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any
from uuid import UUID

from django.utils.functional import Promise
from django.utils.translation import gettext_lazy as _
from msgspec import Struct

from fleet.accounts.models import User
from fleet.audit.kinds import KINDS
from fleet.audit.models import Record
from robots.registry.models import Robot
from teleop.models import WebhookDelivery

TEST = "webhook.test"
_PRIVATE = {"booking.feed", "booking.feed_end"}  # about a person's calendar address
_REQUESTS_ONLY = {"stop.press"}  # the outcome is the event `stop.latch`
_OUTCOMES_ONLY = {"stop.clear", "drive.by"}


class EventCategory(Struct, frozen=True):
    """Kinds of records that a webhook chooses together."""

    label: str | Promise
    kinds: frozenset[str]


EVENT_CATEGORIES = {
    "bookings": EventCategory(
        _("bookings"), frozenset(kind for kind in KINDS if kind.startswith("booking.")) - _PRIVATE
    ),
    "control": EventCategory(
        _("control"),
        frozenset({"control.take", "control.take_over", "control.hand_over", "control.end"}),
    ),
    "stops": EventCategory(_("stops"), frozenset({"stop.press", "stop.latch", "stop.clear", "stop.moves"})),
    "alerts": EventCategory(_("alerts"), frozenset({"alert.begin", "alert.still", "alert.over"})),
    "motions": EventCategory(_("ends of motions"), frozenset({"motion.end", "drive.by", "go.end"})),
    "speech": EventCategory(_("ends of speech"), frozenset({"speech.end"})),
}


def is_event(kind: str, of: int | None, chosen: list[str]) -> bool:
    """Return whether a record is an event for a webhook. `of`: the request, if the record is an outcome."""
    if (kind in _REQUESTS_ONLY and of is not None) or (kind in _OUTCOMES_ONLY and of is None):
        return False
    return any(kind in EVENT_CATEGORIES[name].kinds for name in chosen if name in EVENT_CATEGORIES)


def event_id(delivery: WebhookDelivery) -> str:
    """Return the event's identifier: the same for every attempt and every webhook that gets this record."""
    return f"test_{delivery.pk}" if delivery.record is None else f"rec_{delivery.record}"


def body_of(delivery: WebhookDelivery, texts: bool) -> bytes | None:
    """Return the event as JSON; None if its record expired.

    `texts`: with texts that people wrote or robots spoke.
    """
    if delivery.record is None:
        event = _event(delivery, delivery.made_at, {"note": "A test of this webhook."})
    else:
        records = Record.objects.select_related("actor", "real_actor", "content", "of__content")
        record = records.filter(pk=delivery.record).first()
        if record is None:
            return None
        event = _event(delivery, record.at, data_of(record, texts))
    return json.dumps(event, ensure_ascii=False, separators=(",", ":")).encode()


def _event(delivery: WebhookDelivery, at: datetime, data: dict[str, Any]) -> dict[str, Any]:
    return {"id": event_id(delivery), "type": delivery.kind, "timestamp": rfc3339(at), "data": data}


def data_of(record: Record, texts: bool) -> dict[str, Any]:
    """Return what is sent of a record to people who read its past with names (`robots.access.who_sees`)."""
    data = _data(record, _figures(record))
    if record.real_actor is not None and record.real_actor_id != record.actor_id:
        data["real_person"] = record.real_actor.name
    if texts:
        kept = [one.content_kept for one in (record, record.of) if one is not None]
        data["text"] = next((content.text for content in kept if content and content.text), None)
    return data


def people_of(record: Record) -> set[UUID]:
    """Return whom a record is about: who did it, and the people in its figures."""
    return set(_identifiers([record.actor_id, record.real_actor_id, _figures(record)]))


def data_without_names(record: Record) -> dict[str, Any]:
    """Return what is sent of a record to everybody who sees the robot: no person."""
    figures = {
        name: value
        for name, value in _figures(record).items()
        if name == "booking" or not _identifiers(value)
    }
    return {**_data(record, figures), "person": None, "session": None}


def _data(record: Record, figures: Mapping[str, Any]) -> dict[str, Any]:
    robot = Robot.objects.filter(pk=record.robot_id).first() if record.robot_id else None
    return {
        "record": record.pk,
        "robot": {"slug": robot.slug if robot else None, "name": record.robot_name}
        if record.robot_id
        else None,
        "person": record.actor_name or None,
        "session": str(record.session_id) if record.session_id else None,
        "outcome": record.outcome or None,
        "figures": _with_names(figures),
    }


def _figures(record: Record) -> dict[str, Any]:
    """Return the figures of a record and its request: only the request has for example the motion or the language."""
    return {**(record.of.parameters if record.of else {}), **record.parameters}


def _with_names(figures: Mapping[str, Any]) -> dict[str, Any]:
    """Replace the identifiers of people by their names. The log stores only identifiers."""
    found = {identifier for value in figures.values() for identifier in _identifiers(value)}
    people = User.objects.in_bulk(list(found)) if found else {}
    names = {str(key): person.display_name for key, person in people.items()}
    return {name: _named(value, names) for name, value in figures.items()}


def _identifiers(value: Any) -> list[UUID]:
    match value:
        case Mapping():
            return [found for one in value.values() for found in _identifiers(one)]
        case list():
            return [found for one in value for found in _identifiers(one)]
        case str() if len(value) == 36:
            try:
                return [UUID(value)]
            except ValueError:
                return []
    return []


def _named(value: Any, names: Mapping[str, str]) -> Any:
    match value:
        case Mapping():
            return {name: _named(one, names) for name, one in value.items()}
        case list():
            return [_named(one, names) for one in value]
        case str():
            return names.get(value, value)
    return value


def rfc3339(at: datetime) -> str:
    """Return a time as RFC 3339 in UTC, such as 2026-03-02T09:00:00.000Z."""
    return at.astimezone(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
