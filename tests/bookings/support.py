"""Steps that tests of bookings share."""

from django.urls import reverse

from fleet.bookings.models import HandOffer


def accept(browser, **code):
    """Accept the newest booking that a colleague wants to hand over; `code`: by its link."""
    offer = HandOffer.objects.latest("made_at")
    form = {"answer": "accept", **code}
    return browser.post(reverse("hand-answer", args=[offer.pk]), form, follow=True)
