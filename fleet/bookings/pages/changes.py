"""The pages of changes that took time from people: whom, and undo."""

from __future__ import annotations

from datetime import datetime
from typing import Any
from uuid import UUID

from django.contrib import messages
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import ngettext
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_POST, require_safe

from fleet.accounts.requests import person_of
from fleet.base.formats.sentences import in_words
from fleet.base.web.time_takers import may_take_time
from fleet.base.zones import viewers
from fleet.bookings.losses.collecting import How
from fleet.bookings.losses.door import Namer, stay_lost, title_of
from fleet.bookings.losses.undo import STAYS, changes_of, free_again, pairs_of, undo, undo_refused
from fleet.bookings.models import Change, Turn
from robots.access.selectors import courses_managed_by, robots_managed_by

LISTED = 50


@never_cache
@require_safe
def changes(request: HttpRequest) -> HttpResponse:
    """List the latest changes that took time from people: one's own, for staff all."""
    person, now = person_of(request), timezone.now()
    rows = [
        {
            "change": one,
            "title": title_of(one),
            "count": len(one.losses),
            "undoable": not undo_refused(one, now, person),
        }
        for one in changes_of(person)[:LISTED]
    ]
    context = {
        "rows": rows,
        "courses": courses_managed_by(person).exists(),
        "policies": robots_managed_by(person).exists(),
    }
    return render(request, "bookings/losses/changes.html", context)


@never_cache
@require_safe
def change(request: HttpRequest, change_id: UUID) -> HttpResponse:
    """Show whom a change affected, and the button to undo it."""
    person, now = person_of(request), timezone.now()
    found = get_object_or_404(changes_of(person), pk=change_id)
    refusal = undo_refused(found, now, person)
    context = {
        "change": found,
        "title": title_of(found),
        "rows": _rows(found, Namer(person), now, undoable=refusal is None),
        "refusal": refusal,
        "zone": viewers().key,
    }
    return render(request, "bookings/losses/change.html", context)


@require_POST
@may_take_time
def change_undo(request: HttpRequest, change_id: UUID) -> HttpResponse:
    """Undo a change, and say what came back."""
    found = get_object_or_404(changes_of(person_of(request)), pk=change_id)
    if (refusal := undo_refused(found, timezone.now(), person_of(request))) is not None:
        messages.error(request, in_words(refusal.text))
        return redirect("change", change_id)
    done = undo(change_id=found.pk, actor=person_of(request), now=timezone.now())
    count = len(done.back) + len(done.turns)
    text = ngettext("Undone: %(n)d booking came back.", "Undone: %(n)d bookings came back.", count) % {
        "n": count
    }
    parts = [text, *stay_lost(done.lost, Namer(person_of(request)))]
    if done.entries:
        parts.append(_("Some entries were changed since, and stay as they are: look at their pages."))
    messages.success(request, " ".join(parts))
    return redirect("change", change_id)


def _rows(found: Change, names: Namer, now: datetime, *, undoable: bool) -> list[dict[str, Any]]:
    pairs = pairs_of(found)
    free = free_again(pairs, now) if undoable else {}
    turns = Turn.objects.select_related("person").in_bulk(
        [loss["turn"] for _one, loss in pairs if "turn" in loss]
    )
    rows = [
        {
            "person": (
                turns[loss["turn"]].person if loss.get("turn") in turns else booking.person
            ).display_name,
            "words": names(booking),
            "how": How(loss["how"]).label,
            "gone": undoable and loss["how"] not in STAYS and booking.pk not in free,
        }
        for booking, loss in pairs
    ]
    return sorted(rows, key=lambda row: row["person"].lower())
