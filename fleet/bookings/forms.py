"""The booking form: typed local times, with every refusal named."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from django import forms
from django.core.exceptions import ValidationError
from django.utils.translation import gettext_lazy as _

from fleet.accounts.models import User
from fleet.bookings.rules import Slot, to_utc
from fleet.bookings.selectors import zone_now
from robots.registry.models import Robot
from robots.wire import Refusal

TIME_FORMAT = "%Y-%m-%dT%H:%M"


class LocalTime(forms.CharField):
    """A wall-clock time in the viewer's zone; cleaned to UTC."""

    widget = forms.DateTimeInput(attrs={"type": "datetime-local", "step": "300"}, format=TIME_FORMAT)

    def prepare_value(self, value: Any) -> Any:
        """Return a UTC time as it is typed in the viewer's zone."""
        return value.astimezone(zone_now()).strftime(TIME_FORMAT) if isinstance(value, datetime) else value

    def clean(self, value: Any) -> datetime:
        """Return the moment in UTC. Refused: no time, or one that the clock skips."""
        text = super().clean(value)
        try:
            local = datetime.fromisoformat(text)
        except ValueError as error:
            raise ValidationError(_("Write a date and a time, such as 2026-03-02 14:30.")) from error
        if local.tzinfo is not None:
            raise ValidationError(_("Write the time without a zone: it counts in yours."))
        moment = to_utc(local, zone_now())
        if isinstance(moment, Refusal):
            raise ValidationError(moment.text, code=moment.code)
        return moment


class SlotForm(forms.Form):
    """A robot and a slot. Supervisors may also name another person and a reason that overrides the policy."""

    robot = forms.ModelChoiceField(Robot.objects.none(), label=_("Robot"), to_field_name="slug")
    starts_at = LocalTime(label=_("From"))
    ends_at = LocalTime(label=_("To"))
    purpose = forms.CharField(label=_("Purpose (optional)"), max_length=120, required=False)
    person = forms.CharField(label=_("For another person: their user name"), required=False)
    override = forms.CharField(label=_("Reason to book against the policy"), max_length=200, required=False)

    def __init__(self, *args: Any, robots: Any, supervises: bool, **options: Any) -> None:
        super().__init__(*args, **options)
        choice = self.fields["robot"]
        if isinstance(choice, forms.ModelChoiceField):
            choice.queryset = robots
            choice.empty_label = None
        if not supervises:
            del self.fields["person"], self.fields["override"]

    def clean_person(self) -> User | None:
        """Return the person for whom the slot is booked; None: the one who books."""
        name = self.cleaned_data["person"].strip()
        if not name:
            return None
        person = User.objects.filter(username=name, is_active=True).first()
        if person is None:
            raise ValidationError(_("There is no open account with this user name."))
        return person

    @property
    def slot(self) -> Slot:
        """Return the slot of a valid form."""
        return Slot(self.cleaned_data["starts_at"], self.cleaned_data["ends_at"])
