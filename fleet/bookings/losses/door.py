"""The door of all pages whose change may take time from people, those of the admin, too.

The page's own view makes the change. If it takes time from people, it is undone, and a page says from whom; its button
sends the same form again, with the digest of what was shown.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from uuid import UUID

from django.contrib import messages
from django.contrib.messages.storage import default_storage
from django.http import HttpRequest, HttpResponseBase
from django.shortcuts import render
from django.urls import reverse
from django.utils.html import format_html
from django.utils.translation import gettext as _
from django.utils.translation import ngettext

from fleet.accounts.models import User
from fleet.accounts.requests import person_of
from fleet.audit.kinds import KINDS
from fleet.base.zones import viewers
from fleet.bookings.lessons.members import sharers_of
from fleet.bookings.losses.collecting import How, Loss
from fleet.bookings.losses.weighing import Seen, Weighed, weigh
from fleet.bookings.models import Booking, Change
from fleet.bookings.rules import Slot, from_to
from robots.access.selectors import robots_bookable_by

DIGEST, STAY = "losses_seen", "closed_stay"  # fields of the confirming form


def through_door(request: HttpRequest, answer: Callable[[], HttpResponseBase]) -> HttpResponseBase:
    """Answer a request, or ask first if its change takes time from people."""
    person, kept = person_of(request), request._messages  # type: ignore[attr-defined]
    seen = Seen(request.POST[DIGEST], STAY in request.POST) if DIGEST in request.POST else None
    # Messages that were waiting are shown by the page after the change; those of a trial are dropped.
    request._messages = default_storage(request)  # type: ignore[attr-defined]
    weighed = weigh(answer, actor=person, seen=seen)
    if not weighed.done:
        request._messages = kept  # type: ignore[attr-defined]
        return render(request, "bookings/losses/preview.html", preview(request, weighed), status=409)
    for text in told(weighed):
        messages.success(request, text)
    return weighed.answer


def preview(request: HttpRequest, weighed: Weighed[Any]) -> dict[str, Any]:
    """Return the context of the page that asks."""
    sharers = sharers_of([one.booking for one in weighed.losses if one.turn is None])
    people = {one.person.pk for one in weighed.losses}
    people |= {person.pk for several in sharers.values() for person in several}
    repeated = [
        (name, value)
        for name, values in request.POST.lists()
        if name not in ("csrfmiddlewaretoken", DIGEST, STAY)
        for value in values
    ]
    return {
        "title": title_of(weighed.change) if weighed.change else "",
        "rows": loss_rows(weighed.losses, sharers, person_of(request)),
        "count": len(people),
        "digest": weighed.digest,
        "repeated": repeated,
        "closed": any(one.how is How.CLOSED for one in weighed.losses),
        "again": DIGEST in request.POST,
        "back": request.headers.get("Referer", ""),
        "zone": viewers().key,
    }


def title_of(change: Change) -> str:
    """Return what is changed, in words."""
    kind = KINDS.get(change.kind)
    label = str(kind.label) if kind else change.kind
    return f"{label}: {change.about}" if change.about else label


def loss_rows(losses: list[Loss], sharers: dict[UUID, list[User]], viewer: User) -> list[dict[str, Any]]:
    """Return the losses as rows of a page: by person, then by time."""
    names = Namer(viewer)
    rows = [
        {
            "person": one.person.display_name,
            "words": names(one.booking, one.before["ends_at"]),
            "how": one.how.label,
            "stays": one.how in (How.USELESS, How.CLOSED),
            "until": one.booking.ends_at if one.how is How.SHORTENED else None,
            "why": one.why() if names.knows(one.booking) else "",
            "sharers": [
                person.display_name for person in sharers.get(one.booking.pk, ()) if one.turn is None
            ],
        }
        for one in losses
    ]
    return sorted(rows, key=lambda row: row["person"].lower())


class Namer:
    """Names bookings to a viewer: without the robot, if that is none of theirs."""

    def __init__(self, viewer: User) -> None:
        self._robots = set(robots_bookable_by(viewer).values_list("pk", flat=True))

    def knows(self, booking: Booking) -> bool:
        """Return whether the viewer may learn the robot of a booking."""
        return booking.robot_id in self._robots

    def __call__(self, booking: Booking, ends_at: Any = None) -> str:
        """Return robot and times."""
        if self.knows(booking):
            return booking_words(booking, ends_at)
        times = from_to(Slot(booking.starts_at, ends_at or booking.ends_at), viewers())
        return _("another robot, %(times)s") % {"times": times}


def booking_words(booking: Booking, ends_at: Any = None) -> str:
    """Return robot and times of a booking, in the viewer's zone."""
    slot = Slot(booking.starts_at, ends_at or booking.ends_at)
    return f"{booking.robot.name}, {from_to(slot, viewers())}"


def told(weighed: Weighed[Any]) -> list[str]:
    """Return what is said after a change: what it took and how to undo it, or what came back."""
    texts: list[str] = []
    if weighed.change is not None:
        count = len(weighed.losses)
        took = ngettext("%(n)d booking is affected.", "%(n)d bookings are affected.", count) % {"n": count}
        address = reverse("change", args=[weighed.change.pk])
        texts.append(
            format_html('{} <a href="{}">{}</a>', took, address, _("See whom it affects, or undo it"))
        )
    if weighed.came_back or weighed.stay_lost:  # by staff only
        count = len(weighed.came_back)
        text = ngettext("%(n)d booking came back.", "%(n)d bookings came back.", count) % {"n": count}
        texts.append(" ".join([text, *stay_lost(weighed.stay_lost)]))
    return texts


def stay_lost(bookings: list[Booking], words: Callable[[Booking], str] | None = None) -> list[str]:
    """Return a sentence about the bookings that cannot come back; nothing if all do."""
    if not bookings:
        return []
    named = "; ".join(f"{one.person.display_name}: {(words or booking_words)(one)}" for one in bookings)
    return [_("Over, taken by others or changed since: %(bookings)s.") % {"bookings": named}]
