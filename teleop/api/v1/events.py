"""Events of robots as server-sent events, from the audit log. A client that connects again misses nothing."""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import AsyncIterator
from datetime import timedelta
from typing import Annotated
from uuid import UUID
from weakref import WeakSet

from django.http import HttpResponse, StreamingHttpResponse
from django.http.response import HttpResponseBase
from django.utils import timezone
from msgspec import Meta, Struct
from rest_framework.renderers import BaseRenderer, JSONRenderer
from rest_framework.request import Request

from fleet.accounts.models import User
from fleet.accounts.selectors import signed_in
from fleet.audit.models import Record
from robots.access import who_sees
from robots.access.selectors import robots_visible_to
from robots.shared.sentences import say
from robots.shared.wire import Refusal
from teleop.api.v1.framework.operation import ApiView, reads
from teleop.api.v1.framework.problems import Problem
from teleop.background.database import in_database
from teleop.webhooks.event_reader import lines_after, newest_record
from teleop.webhooks.events import (
    EVENT_CATEGORIES,
    data_of,
    data_without_names,
    is_event,
    people_of,
    rfc3339,
)

CHECK_S = 0.7  # between two reads of the log: a stream ends within a second after its token ends
REST_S = 0.1  # between two reads while older records remain to be read
QUIET_S = 15.0  # after this time without events, a comment shows that the stream is alive
LONGEST_S = 600.0  # then the stream ends and the client connects again: unread bytes are not kept for ever
# Events of others that come to those who do not read their past; for a new connection
RECENT = timedelta(minutes=15)
MOST_STREAMS = 50  # of this process
MOST_OF_PERSON = 10

_FULL = Refusal("busy", "Too many event streams are open: try again later.", "wire")
_FULL_OF_YOURS = Refusal(
    "busy", say("You have {most} event streams open: close one first.", most=MOST_OF_PERSON), "wire"
)


class _Places:
    """The places of open streams. A place is given back when nothing refers to it any more, however its stream ends."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._taken: WeakSet[Place] = WeakSet()

    def reserve(self, person: UUID) -> Place:
        """Take a place. Raises Problem if there is none."""
        with self._lock:
            of_person = [place for place in self._taken if place.person == person]
            if len(self._taken) >= MOST_STREAMS:
                raise Problem(_FULL)
            if len(of_person) >= MOST_OF_PERSON:
                raise Problem(_FULL_OF_YOURS)
            place = Place(person)
            self._taken.add(place)
            return place


_places = _Places()


class Place(Struct, frozen=True, weakref=True, eq=False):
    """The place of an open stream."""

    person: UUID


class EventStream(BaseRenderer):
    """Accept requests whose header Accept names event streams."""

    media_type = "text/event-stream"
    format = "events"


class Reader(Struct, frozen=True):
    """The person who reads a stream, and the robots of the stream."""

    user: User
    key: str  # of the token, or of the session
    robots: frozenset[UUID]  # empty: all that they may see
    slug: str | None
    place: Place


class Seen(Struct, frozen=True):
    """The robots that a reader may see now, and of which of them they read the past of others."""

    robots: set[UUID]
    past: who_sees.Reader


class EventsAsked(Struct, frozen=True, forbid_unknown_fields=True):
    """Filters of events."""

    robot: Annotated[str, Meta(max_length=100, description="Only of this one.")] | None = None
    after: (
        Annotated[int, Meta(ge=0, description="After this number; the header Last-Event-ID says the same.")]
        | None
    ) = None


class EventsView(ApiView):
    tag = "events"
    renderer_classes = [JSONRenderer, EventStream]

    @reads("events", "Follow the events of robots", content_type="text/event-stream")
    def get(self, query: EventsAsked) -> HttpResponseBase:
        """Server-sent events: bookings, control, stops, ends of motions and speech, as webhooks have them. Each has the
        number of its record as id; with Last-Event-ID nothing is missed. Events of a robot that the person may no
        longer see do not come. What others do comes without names, and at most 15 minutes late, to people who do not
        supervise the robot. The stream ends after ten minutes, or when the token ends: connect again."""
        if query.robot is not None:
            self.robot(query.robot)
        token = self.token
        bound = frozenset(UUID(robot) for robot in token.robots) if token else frozenset()
        start, newest = _last_event(self.request, query), newest_record()
        start = newest if start is None else min(start, newest)
        if self.request.method == "HEAD":  # the stream would never end
            return HttpResponse(content_type="text/event-stream")
        place = _places.reserve(self.person.pk)
        response = StreamingHttpResponse(
            _stream(Reader(self.person, self.sign_in, bound, query.robot, place), start),
            content_type="text/event-stream",
        )
        response["Cache-Control"] = "no-store"
        response["X-Accel-Buffering"] = "no"
        return response


def _last_event(request: Request, query: EventsAsked) -> int | None:
    """Return the number of the event that the client read last; None: the client gives no valid number."""
    said = request.headers.get("Last-Event-ID", "")
    return int(said) if said.isascii() and said.isdigit() and len(said) < 20 else query.after


async def _stream(reader: Reader, start: int) -> AsyncIterator[bytes]:
    """Yield the events after record `start`, until the reader's sign-in ends, or for `LONGEST_S`.

    The stream has its place as long as the generator exists.
    """
    yield b"retry: 2000\n\n"
    loop = asyncio.get_running_loop()
    began_s = said_s = loop.time()
    while loop.time() - began_s < LONGEST_S:
        seen = await in_database(_seen_by, reader)
        if seen is None:
            return
        before = start
        start, events = await in_database(_events, seen, start)
        if events:
            yield b"".join(events)
            said_s = loop.time()
        elif loop.time() - said_s > QUIET_S:
            yield b": nothing new\n\n"
            said_s = loop.time()
        await asyncio.sleep(CHECK_S if start == before else REST_S)


def _seen_by(reader: Reader) -> Seen | None:
    """Return what the reader may see now; None: the reader is no longer signed in."""
    person = (reader.user.pk, reader.key)
    user = signed_in([person]).get(person)
    if user is None:
        return None
    robots = robots_visible_to(user)
    if reader.slug is not None:
        robots = robots.filter(slug=reader.slug)
    found = set(robots.values_list("pk", flat=True))
    return Seen(found & reader.robots if reader.robots else found, who_sees.reader_of(user))


def _events(seen: Seen, start: int) -> tuple[int, list[bytes]]:
    """Read records after `start`. Return the number of the last record read, and the events that are seen."""
    lines = lines_after(start)
    chosen = [
        line.pk
        for line in lines
        if line.robot in seen.robots and is_event(line.kind, line.of, list(EVENT_CATEGORIES))
    ]
    records = Record.objects.select_related("actor", "real_actor", "content", "of__content").in_bulk(chosen)
    events = [_event(records[number], seen.past) for number in chosen if number in records]
    return lines[-1].pk if lines else start, [event for event in events if event]


def _event(record: Record, reader: who_sees.Reader) -> bytes:
    """Return the event as this person reads it; nothing if it is the past of others."""
    named = reader.sees_past(record.robot_id, people_of(record))
    if not named and timezone.now() - record.at > RECENT:
        return b""
    data = data_of(record, texts=False) if named else data_without_names(record)
    data = {"timestamp": rfc3339(record.at), **data}
    text = json.dumps(data, ensure_ascii=False, separators=(",", ":"))
    return f"id: {record.pk}\nevent: {record.kind}\ndata: {text}\n\n".encode()
