"""The page of a weekly series: all its dates, and changes of all from a day on."""

from __future__ import annotations

from datetime import date, datetime
from typing import Any, cast
from uuid import UUID

from django import forms
from django.contrib import messages
from django.core.exceptions import ValidationError
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.translation import gettext, ngettext
from django.utils.translation import gettext_lazy as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods

from fleet.accounts.requests import person_of
from fleet.base.formats.dates import dated
from fleet.base.zones import viewers, zone_of
from fleet.bookings.changes.whole_series import Change, Date, dates_of, series_cancel, series_move, series_of
from fleet.bookings.models import DAY_NAMES, Booking
from fleet.bookings.rules import LONGEST, Slot, from_to
from fleet.bookings.selectors import is_recorded
from robots.access.selectors import manages_robot, robots_supervised_by
from robots.registry.models import Robot

_LONGEST_MIN = round(LONGEST.total_seconds() / 60)


class SeriesChangeForm(forms.Form):
    """New facts for the dates to come from a day on. Fields that are left empty change nothing."""

    since = forms.DateField(label=_("From this day on"), widget=forms.DateInput({"type": "date"}, "%Y-%m-%d"))
    weekday = forms.TypedChoiceField(
        label=_("Weekday"),
        choices=[("", _("as it is")), *((str(number), name) for number, name in enumerate(DAY_NAMES))],
        coerce=int,
        empty_value=None,
        required=False,
    )
    begins = forms.TimeField(
        label=_("Begin"), widget=forms.TimeInput({"type": "time"}, "%H:%M"), required=False
    )
    minutes = forms.IntegerField(
        label=_("Length, minutes"), min_value=1, max_value=_LONGEST_MIN, required=False
    )
    robot = forms.ModelChoiceField(
        Robot.objects.none(),
        label=_("Robot"),
        to_field_name="slug",
        required=False,
        empty_label=_("as it is"),
    )
    override = forms.CharField(label=_("Reason to book against the policy"), max_length=200, required=False)

    def __init__(self, *args: Any, robots: Any, overrides: bool, **options: Any) -> None:
        super().__init__(*args, **options)
        cast(forms.ModelChoiceField, self.fields["robot"]).queryset = robots  # type: ignore[type-arg]
        if not overrides:
            del self.fields["override"]

    def clean(self) -> dict[str, Any]:
        """Check that something is to change."""
        values: dict[str, Any] = super().clean() or self.cleaned_data
        if all(values.get(name) is None for name in ("weekday", "begins", "minutes", "robot")):
            raise ValidationError(_("Choose what to change: weekday, begin, length or robot."))
        return values

    @property
    def change(self) -> Change:
        """Return the change of a valid form."""
        values = self.cleaned_data
        return Change(values["weekday"], values["begins"], values["minutes"], values["robot"])


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def whole_series(request: HttpRequest, series: UUID) -> HttpResponse:
    """Show a series, and move or cancel its dates to come. Each change has a preview."""
    person, now = person_of(request), timezone.now()
    found = list(series_of(person, series))
    if not found:
        raise Http404
    dates = dates_of(found, now)
    first = next((one.booking for one in dates if one.to_come), found[-1])
    today = now.astimezone(zone_of("")).date()
    options: dict[str, Any] = {
        "robots": robots_supervised_by(person),
        "overrides": manages_robot(person, first.robot),
        "initial": {"since": max(today, first.starts_at.astimezone(zone_of("")).date())},
    }
    form = SeriesChangeForm(**options)
    preview: list[Date] = []
    if request.method == "POST" and request.POST.get("action") == "cancel":
        since = _day(request.POST.get("since", "")) or today
        reason = request.POST.get("reason", "").replace("\0", "").strip()[:200]
        done = series_cancel(found, since=since, actor=person, now=now, reason=reason)
        return _told(request, series, done, gettext("Cancelled: %(done)s. %(left)s"))
    if request.method == "POST":
        form = SeriesChangeForm(request.POST, **options)
        if form.is_valid():
            override, only = form.cleaned_data.get("override", ""), request.POST.get("action") != "move"
            since = form.cleaned_data["since"]
            done = series_move(
                found, form.change, since=since, actor=person, now=now, override=override, preview=only
            )
            if not only:
                return _told(request, series, done, gettext("Moved: %(done)s. %(left)s"))
            preview = done
    context = {
        "first": first,
        "words": _in_words(first),
        "recorded": is_recorded(first),
        "rows": [_row(one) for one in dates],
        "to_come": sum(one.to_come for one in dates),
        "preview": [{**_row(one), "new": _new(one)} for one in preview],
        "previewed": bool(preview) or (form.is_bound and form.is_valid()),
        "form": form,
        "zone": viewers().key,
        "lab": zone_of("").key,
    }
    return render(request, "bookings/policies/whole_series.html", context, status=400 if form.errors else 200)


def _told(request: HttpRequest, series: UUID, done: list[Date], text: str) -> HttpResponse:
    """Tell how many dates were changed and which were not, and go back to the page."""
    left = [one for one in done if one.refusals]
    number = len(done) - len(left)
    stay = gettext("These stay as they are: %(dates)s.") % {
        "dates": "; ".join(dated(one.booking.starts_at.astimezone(viewers()), "D j M") for one in left)
    }
    count = ngettext("%(number)d date", "%(number)d dates", number) % {"number": number}
    level = messages.warning if left else messages.success
    level(request, (text % {"done": count, "left": stay if left else ""}).strip())
    return redirect("booking-whole-series", series=series)


def _in_words(booking: Booking) -> str:
    """Return weekday and times of a series as those of one of its bookings."""
    lab = zone_of("")
    starts, ends = booking.starts_at.astimezone(lab), booking.ends_at.astimezone(lab)
    return f"{booking.robot.name}, {dated(starts, 'l')} {starts:%H:%M} - {ends:%H:%M}"


def _row(one: Date) -> dict[str, Any]:
    booking = one.booking
    words = f"{booking.robot.name}, {from_to(Slot(booking.starts_at, booking.ends_at), viewers())}"
    return {
        "booking": booking,
        "words": words,
        "stage": one.stage,
        "refusals": one.refusals,
        "begun": False,
        "to_come": one.to_come,
    }


def _new(one: Date) -> str:
    return from_to(one.slot, viewers()) if one.slot else ""


def _day(text: str) -> date | None:
    try:
        return datetime.strptime(text, "%Y-%m-%d").date()  # noqa: DTZ007  # a day has no zone
    except ValueError:
        return None
