"""The page of the lab's holidays: staff add and remove them, or read them from a calendar file."""

from __future__ import annotations

from typing import Any
from uuid import UUID

from django import forms
from django.contrib import messages
from django.core.exceptions import PermissionDenied, ValidationError
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy, ngettext
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST

from fleet.accounts.requests import person_of
from fleet.base.web.time_takers import may_take_time
from fleet.base.zones import zone_of
from fleet.bookings.changes.holiday_files import last_read, read_file
from fleet.bookings.changes.holidays import MOST, Entry, holiday_remove, holidays_add, new_among
from fleet.bookings.models import Holiday
from fleet.bookings.pages.forms import typed_day
from robots.access.selectors import lab_date


class HolidayForm(forms.ModelForm):  # type: ignore[type-arg]
    """One holiday."""

    last_day = forms.DateField(
        label=gettext_lazy("Last day (empty: only one day)"),
        widget=forms.DateInput({"type": "date"}),
        required=False,
    )

    class Meta:
        model = Holiday
        fields = ["name", "first_day", "last_day"]
        widgets = {"first_day": forms.DateInput({"type": "date"})}  # Django's way

    def clean_last_day(self) -> Any:
        """Return the last day; the first, if the field is empty."""
        return self.cleaned_data["last_day"] or self.cleaned_data.get("first_day")


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
@may_take_time
def holidays(request: HttpRequest) -> HttpResponse:
    """List the holidays to come; for staff, add one, or show what a calendar file would add, then add it."""
    person, action = person_of(request), request.POST.get("action", "")
    if request.method != "POST":
        return _page(request)
    if not person.is_staff:
        raise PermissionDenied("Only staff change the holidays of the lab.")
    if action == "read":
        return _read(request)
    if action == "import":
        entries = [entry for text in request.POST.getlist("entry")[:MOST] if (entry := _entry(text))]
        return _add(request, entries)
    form = HolidayForm(request.POST)
    if not form.is_valid():
        return _page(request, form)
    values = form.cleaned_data
    return _add(request, [Entry(values["first_day"], values["last_day"], values["name"])])


@require_POST
def remove(request: HttpRequest, holiday_id: UUID) -> HttpResponse:
    """Remove a holiday."""
    if not person_of(request).is_staff:
        raise PermissionDenied("Only staff change the holidays of the lab.")
    holiday_remove(holiday_id=holiday_id, actor=person_of(request))
    messages.success(request, _("The robots can be booked on these days again."))
    return redirect("holidays")


def _read(request: HttpRequest) -> HttpResponse:
    file = request.FILES.get("file")
    try:
        if file is None:
            raise ValidationError(_("Choose a calendar file (.ics)."))
        entries, left = read_file(file.read())
    except ValidationError as error:
        return _page(request, faults=error.messages)
    if not (new := new_among(entries)) and not left:
        messages.info(request, _("The file has no day to come that is not in the list."))
        return redirect("holidays")
    return _page(request, found=new, known=len(entries) - len(new), left=left)


def _add(request: HttpRequest, entries: list[Entry]) -> HttpResponse:
    try:
        made = holidays_add(entries, actor=person_of(request))
    except ValidationError as error:
        return _page(request, faults=error.messages)
    text = ngettext("%(n)d holiday added.", "%(n)d holidays added.", len(made)) % {"n": len(made)}
    messages.success(request, text)
    return redirect("holidays")


def _entry(text: str) -> Entry | None:
    """Return an entry of the preview: "2026-12-24 2026-12-26 Christmas"."""
    first, _blank, rest = text.replace("\0", "").partition(" ")
    last, _blank, name = rest.partition(" ")
    first_day, last_day = typed_day(first), typed_day(last)
    return Entry(first_day, last_day, name) if first_day and last_day and name else None


def _page(
    request: HttpRequest,
    form: HolidayForm | None = None,
    faults: list[str] | None = None,
    found: list[Entry] | None = None,
    known: int = 0,
    left: list[str] | None = None,
) -> HttpResponse:
    of_form = [str(error) for errors in (form.errors.values() if form else ()) for error in errors]
    faults = [*(faults or ()), *of_form]
    context = {
        "holidays": Holiday.objects.filter(last_day__gte=lab_date()),
        "form": form or HolidayForm(),
        "faults": faults,
        "found": [(one, f"{one.first_day} {one.last_day} {one.name}") for one in found or ()],
        "known": known,
        "left": left,
        "last_read": last_read(),
        "lab": zone_of("").key,
    }
    return render(request, "bookings/policies/holidays.html", context, status=400 if faults else 200)
