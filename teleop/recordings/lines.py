"""Recordings as pages list them: only what the person sees of each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from django.utils.translation import gettext_lazy as _
from msgspec import Struct

from fleet.accounts.models import User
from fleet.base.durations import duration_text
from robots.access.who_sees import Reader
from robots.recordings.models import Recording
from teleop.models import ControlSession
from teleop.recordings import times
from teleop.recordings.listing import seen
from teleop.recordings.selectors import Sight, recordings_of_session

EVENTS = {
    "stop": _("emergency stop"),
    "gate": _("slowed or stopped for safety"),
    "fault": _("fault"),
    "contact": _("contact"),
    "keep": _("marked by hand"),
}
BEFORE_S = 10.0  # a link to an event begins so long before it


class Event(Struct, frozen=True):
    """Something that happened in a recording, s since its begin."""

    at_s: float
    event: str
    what: str
    text: str
    by: str
    is_logged: bool = False  # the log has it, not the recording

    @property
    def begin_s(self) -> float:
        """Return where a replay of it begins."""
        return max(self.at_s - BEFORE_S, 0.0)


class Line(Struct, frozen=True):
    """A recording in a list."""

    recording: Recording
    whole: bool
    tells_owner: bool
    lasts: str
    events: list[Event]
    kinds: list[str]  # of the events, each once


def lines(user: User, recordings: Sequence[Recording], reader: Reader, event: str = "") -> list[Line]:
    """Return the recordings of which the person sees anything. `event`: only those in which they see it."""
    return [_line(sight) for sight in seen(user, recordings, reader, event)]


def lines_of_session(user: User, session: ControlSession, reader: Reader) -> list[Line]:
    """Return the recordings that show a part of a session, the earliest first."""
    found = recordings_of_session(session).select_related("robot", "person").defer("topics")
    return lines(user, list(found), reader)


def events_of(sight: Sight) -> list[Event]:
    """Return what happened in the parts that the person sees."""
    return [_event(event, times.since_s(sight.recording, event["at"])) for event in sight.events]


def _event(event: dict[str, Any], at_s: float) -> Event:
    kind, text, by = (str(event.get(name, "")) for name in ("event", "text", "by"))
    return Event(at_s, kind, str(EVENTS.get(kind, kind)), text, by)


def _line(sight: Sight) -> Line:
    seen_s = sum((part.ends_at - part.begins_at).total_seconds() for part in sight.parts)
    events = events_of(sight)
    kinds = list(dict.fromkeys(event.what for event in events))
    return Line(sight.recording, sight.whole, sight.tells_owner, duration_text(seen_s), events, kinds)
