"""The pages on which a booking is handed to a colleague: a link for them, and their answer."""

from __future__ import annotations

from uuid import UUID

import segno
from django.contrib import messages
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import timezone
from django.utils.safestring import mark_safe
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_POST, require_safe

from fleet.accounts.requests import person_of
from fleet.base.formats.sentences import words_of
from fleet.base.web.origin import public_url
from fleet.bookings.changes.handing import hand_answer, hand_ask, hand_withdraw, offer_with
from fleet.bookings.losses.door import booking_words
from fleet.bookings.models import Booking, HandOffer
from fleet.bookings.services import BookingRefused
from robots.access.selectors import robots_bookable_by


@never_cache
@require_POST
def make_link(request: HttpRequest, booking_id: UUID) -> HttpResponse:
    """Make a link by which a colleague may take a booking, and show it, this once."""
    person = person_of(request)
    found = get_object_or_404(Booking, pk=booking_id, robot__in=robots_bookable_by(person).values("pk"))
    version = request.POST.get("version", "")
    try:
        offer, code = hand_ask(
            booking_id=found.pk,
            version=int(version) if version.isascii() and version.isdigit() and len(version) < 6 else 0,
            to=None,
            actor=person,
            now=timezone.now(),
        )
    except BookingRefused as error:
        messages.error(request, words_of(error.refusal))
        return redirect("booking", booking_id)
    address = public_url(request, reverse("hand-link", args=[code]))
    picture = segno.make(address, error="m", micro=False).svg_inline(scale=6, light="white", border=4)
    context = {"words": booking_words(found), "offer": offer, "address": address}
    return render(request, "bookings/hand.html", {**context, "picture": mark_safe(picture)})  # noqa: S308 - a QR code


@never_cache
@require_safe
def link(request: HttpRequest, code: str) -> HttpResponse:
    """Show the booking that this link offers."""
    return _link_page(request, code)


def _link_page(request: HttpRequest, code: str, error: BookingRefused | None = None) -> HttpResponse:
    offer = offer_with(code, timezone.now())
    if offer is None:
        return render(request, "bookings/hand.html", {"words": _("Hand to a colleague")}, status=404)
    context = {"words": booking_words(offer.booking), "offer": offer, "code": code}
    context |= {"refusals": error.refusals if error else []}
    return render(request, "bookings/hand.html", context, status=409 if error else 200)


@require_POST
def answer(request: HttpRequest, offer_id: UUID) -> HttpResponse:
    """Accept or decline an offer, or withdraw it."""
    person, now, chosen = person_of(request), timezone.now(), request.POST.get("answer")
    offer = get_object_or_404(HandOffer.objects.select_related("booking__robot"), pk=offer_id)
    code = request.POST.get("code", "")
    try:
        if chosen == "withdraw":
            hand_withdraw(offer_id=offer.pk, actor=person, now=now)
            messages.success(request, _("Withdrawn: the booking stays yours."))
            return redirect("booking", offer.booking_id)
        accept = chosen == "accept"
        booking = hand_answer(offer_id=offer.pk, actor=person, accept=accept, now=now, code=code)
    except BookingRefused as error:
        if code:
            return _link_page(request, code, error)
        for refusal in error.refusals:
            messages.error(request, words_of(refusal))
        return redirect("bookings-mine")
    words = booking_words(Booking.objects.select_related("robot").get(pk=booking.pk))
    text = _("Accepted: %(booking)s.") if accept else _("Declined: %(booking)s.")
    messages.success(request, text % {"booking": words})
    return redirect("bookings-mine")
