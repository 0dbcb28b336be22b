"""Forms of bookings, with times in the viewer's zone."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from contextlib import suppress
from datetime import UTC, date, datetime
from itertools import product
from typing import Any, cast
from uuid import UUID
from zoneinfo import ZoneInfo

from django import forms
from django.core.exceptions import ValidationError
from django.http import QueryDict
from django.utils.html import format_html, format_html_join
from django.utils.safestring import SafeString
from django.utils.translation import gettext_lazy as _

from fleet.base.database import rows
from fleet.base.zones import viewers
from fleet.bookings.changes.policy_changes import POLICY_FIELDS
from fleet.bookings.changes.series import MOST_WEEKS
from fleet.bookings.models import DAY_NAMES, MOST_INTERVALS, WEEKDAYS, OutOfService, Policy
from fleet.bookings.rules import Slot, moments_of, to_utc
from fleet.bookings.services import MOST_TURN_MIN
from robots.access.models import Course, RobotGroup
from robots.registry.models import Robot
from robots.shared.sentences import is_shown_twice, offset
from robots.shared.wire import Refusal

TIME_FORMAT = "%Y-%m-%dT%H:%M"
LENGTH = len("2026-03-02T14:30")
YEARS = range(2000, 2200)  # other years are typing errors
# An opening interval: hour, minutes if any, "-" or a dash, and the same of its end
INTERVAL = re.compile(
    r"\s*(\d\d?)(?:[:.h]([0-5]\d))?\s*[-\u2013\u2014]\s*(\d\d?)(?:[:.h]([0-5]\d))?\s*", re.ASCII
)
LONG_YEAR = re.compile(r"\s*\d{5,}-")  # a browser's field accepts six digits


def typed_day(text: str | None) -> date | None:
    """Return the day at the start of a text such as 2026-03-02; None if it is invalid or not in `YEARS`."""
    try:
        found = date.fromisoformat((text or "")[:10])
    except ValueError:
        return None
    return found if found.year in YEARS else None


def typed_time(moment: datetime) -> str:
    """Return a moment as the forms read it: wall-clock time in the viewer's zone, with its offset if it comes twice."""
    local = moment.astimezone(viewers())
    return local.isoformat(timespec="minutes") if is_shown_twice(local) else f"{local:{TIME_FORMAT}}"


class LocalTimeInput(forms.DateTimeInput):
    """A browser's field of date and time. It knows no offset: that of a time that comes twice has a field beside it."""

    twice: Sequence[datetime] = ()  # the moments of what was typed, to choose from

    def __init__(self) -> None:
        super().__init__(attrs={"type": "datetime-local", "step": "300"})

    def render(self, name: str, value: Any, attrs: Any = None, renderer: Any = None) -> SafeString:
        """Return the field; beside it the offset, if the value has one."""
        exact = None
        with suppress(ValueError):
            exact = datetime.fromisoformat(value or "")
        if self.twice:
            return super().render(name, value, attrs, renderer) + self._choice(name)
        if exact is None or exact.tzinfo is None:
            return super().render(name, value, attrs, renderer)
        hidden = '<small class="quiet">{}: {}</small><input type="hidden" name="{}_exact" value="{}">'
        field = super().render(name, f"{exact:{TIME_FORMAT}}", attrs, renderer)
        return field + format_html(hidden, f"{exact:%H:%M}", offset(exact), name, value)

    def _choice(self, name: str) -> SafeString:
        moments = [moment.astimezone(viewers()) for moment in self.twice]
        options = ((one.isoformat(timespec="minutes"), offset(one)) for one in moments)
        choice = '<select name="{}_exact" aria-label="{}"><option value=""></option>{}</select>'
        return format_html(
            choice,
            name,
            f"{moments[0]:%H:%M}",
            format_html_join("", '<option value="{}">{}</option>', options),
        )

    def value_from_datadict(self, data: Any, files: Any, name: str) -> Any:
        """Return the typed time, with the offset if it is still that of the hidden field."""
        typed, exact = data.get(name), data.get(f"{name}_exact", "")
        return exact if typed and exact[:LENGTH] == typed else typed


class LocalTime(forms.CharField):
    """A wall-clock time in the viewer's zone; cleaned to UTC."""

    is_end = False
    widget = LocalTimeInput
    kept: datetime | None = None  # the moment of a booking that is changed, if the same time is typed

    def prepare_value(self, value: Any) -> Any:
        """Return a UTC time as text in the viewer's zone, in the format of the field."""
        return typed_time(value) if isinstance(value, datetime) else value

    def clean(self, value: Any) -> datetime:
        """Return the moment in UTC.

        Refuse text without a time, a time that the clock skips, or a wrong year.
        """
        text = super().clean(value)
        wrong_year = ValidationError(_("Look at the year: it is before 2000 or after 2199."), "wrong_year")
        if LONG_YEAR.match(text):
            raise wrong_year
        try:
            local = datetime.fromisoformat(text)
        except ValueError as error:
            raise ValidationError(_("Write a date and a time, such as 2026-03-02 14:30.")) from error
        if local.year not in YEARS:
            raise wrong_year
        wall, zone = local.replace(tzinfo=None), viewers()
        if self.kept is not None and f"{self.kept.astimezone(zone):{TIME_FORMAT}}" == f"{wall:{TIME_FORMAT}}":
            return self.kept
        twice = moments_of(wall, zone)
        if local.tzinfo is not None and (len(twice) < 2 or local not in twice):
            raise ValidationError(_("Write the time without a zone: it counts in yours."))
        if local.tzinfo is not None:
            return local.astimezone(UTC)
        moment = to_utc(wall, zone, is_end=self.is_end)
        if isinstance(moment, Refusal):
            raise ValidationError(moment.text, code=moment.code)
        if len(twice) == 2:
            cast(LocalTimeInput, self.widget).twice = twice
            raise TwiceError(twice, zone)
        return moment


class TwiceError(ValidationError):
    """A typed time comes twice, because clocks go back: the person must choose one of these moments."""

    def __init__(self, moments: list[datetime], zone: ZoneInfo) -> None:
        first, second = (moment.astimezone(zone) for moment in moments)
        key = _("%(time)s comes twice, because clocks go back: choose %(first)s or %(second)s.")
        values = {"time": f"{first:%H:%M}", "first": offset(first), "second": offset(second)}
        super().__init__(key % values, code="time_twice")
        self.moments = moments


class LocalEnd(LocalTime):
    """The wall-clock time of an end."""

    is_end = True


class OptionalLocalEnd(LocalEnd):
    """The wall-clock time of an end that may be left empty: None."""

    def clean(self, value: Any) -> Any:
        """Return the moment in UTC, or None."""
        return super().clean(value) if (value or "").strip() else None


class RecordField(forms.BooleanField):
    """The wish that a booking is recorded."""

    def __init__(self) -> None:
        super().__init__(label=_("Record what the robot senses in it"), required=False)


class SeriesForm(forms.Form):
    """Weekly series, one for each robot: the first slot, the number of weeks, and days that are left out."""

    robot = forms.ModelMultipleChoiceField(
        Robot.objects.none(),
        label=_("Robots"),
        to_field_name="slug",
        widget=forms.CheckboxSelectMultiple,
    )
    starts_at = LocalTime(label=_("First slot from"))
    ends_at = LocalEnd(label=_("First slot to"))
    weeks = forms.IntegerField(label=_("Weeks"), min_value=1, max_value=MOST_WEEKS, initial=12)
    without = forms.CharField(
        label=_("Without these days (such as 2026-12-24, 2026-12-31)"), max_length=400, required=False
    )
    course = forms.ModelChoiceField(
        Course.objects.none(),
        label=_("Lessons of"),
        to_field_name="slug",
        required=False,
        empty_label=_("no course"),
    )
    turn_min = forms.IntegerField(
        label=_("Minutes per turn (empty: no turns)"), min_value=1, max_value=MOST_TURN_MIN, required=False
    )
    purpose = forms.CharField(label=_("Purpose"), max_length=120)
    record = RecordField()
    override = forms.CharField(label=_("Reason to book against the policy"), max_length=200, required=False)

    def __init__(self, *args: Any, robots: Any, courses: Any, overrides: bool, **options: Any) -> None:
        super().__init__(*args, **options)
        cast(forms.ModelChoiceField, self.fields["robot"]).queryset = robots  # type: ignore[type-arg]
        cast(forms.ModelChoiceField, self.fields["course"]).queryset = courses  # type: ignore[type-arg]
        if not overrides:
            del self.fields["override"]

    def clean_without(self) -> list[date]:
        """Return the days that are left out."""
        try:
            return [
                date.fromisoformat(day.strip())
                for day in self.cleaned_data["without"].split(",")
                if day.strip()
            ]
        except ValueError as error:
            raise ValidationError(_("Write days such as 2026-12-24, with commas between them.")) from error


class OpeningField(forms.CharField):
    """The opening intervals of one day: "08:00-12:00, 13:00-20:00", or "8-12, 13-20". Empty: closed."""

    def __init__(self, **options: Any) -> None:
        super().__init__(required=False, max_length=120, **options)

    def prepare_value(self, value: Any) -> Any:
        """Return intervals as text."""
        if isinstance(value, list):
            return ", ".join(f"{opens}-{closes}" for opens, closes in value)
        return value

    def clean(self, value: Any) -> Any:
        """Return the intervals in order. Raises `ValidationError` for other texts, and for too many intervals."""
        typed = [part for part in re.split(r"[,;]", super().clean(value)) if part.strip()]
        found = [self._interval(part) for part in typed]
        if len(found) > MOST_INTERVALS:
            key = _("%(day)s: write at most %(most)d opening times.")
            raise ValidationError(key, params={"day": self.label, "most": MOST_INTERVALS})
        return sorted(found)

    def _interval(self, text: str) -> list[str]:
        if match := INTERVAL.fullmatch(text):
            opens_h, opens_min, closes_h, closes_min = (int(part or 0) for part in match.groups())
            begin = f"{opens_h:02}:{opens_min:02}"
            end = "24:00" if (closes_h, closes_min) == (0, 0) else f"{closes_h:02}:{closes_min:02}"
            if begin < "24:00" >= end:
                return [begin, end]
        key = _("%(day)s: write opening times such as 08:00-12:00, 13:00-20:00.")
        raise ValidationError(key, params={"day": self.label})


class PolicyForm(forms.ModelForm):  # type: ignore[type-arg]
    """A booking policy; the opening hours have a field for each weekday: "08:00-12:00, 13:00-20:00"."""

    class Meta:
        model = Policy
        fields = [name for name in POLICY_FIELDS if name != "opening"]

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        for name in ("day_min", "week_min", "at_once"):
            field = self.fields[name]
            field.label = _("%(limit)s (empty: no limit)") % {"limit": field.label}
        for day, label in zip(WEEKDAYS, DAY_NAMES, strict=True):
            self.fields[day] = OpeningField(label=label, initial=self.instance.opening.get(day))

    def clean(self) -> dict[str, Any]:
        """Build `opening` from the fields of the weekdays. No hours at all: always open."""
        values: dict[str, Any] = super().clean() or self.cleaned_data
        opening = {}
        for day in WEEKDAYS:
            if intervals := values.pop(day, None):
                opening[day] = intervals
        values["opening"] = self.instance.opening = opening
        return values

    @property
    def limits(self) -> list[Any]:
        """Return the fields except the opening hours."""
        return [self[name] for name in self.fields if name not in WEEKDAYS]

    @property
    def week(self) -> list[dict[str, Any]]:
        """Return the fields of the opening hours, one entry for each weekday."""
        return [
            {"name": name, "day": day, "hours": self[day]}
            for name, day in zip(DAY_NAMES, WEEKDAYS, strict=True)
        ]

    @staticmethod
    def with_copied(typed: QueryDict) -> QueryDict:
        """Return what a person typed, with the hours of the day that they copy to all days."""
        found = typed.copy()
        if (hours := typed.get(typed.get("copy", ""))) is not None:
            for day in WEEKDAYS:
                found[day] = hours
        return found


class OutOfServiceForm(forms.Form):
    """A period in which a robot, or every robot of a group, cannot be driven."""

    robots = forms.ChoiceField(label=_("Robot or group"))
    starts_at = LocalTime(label=_("From"))
    ends_at = OptionalLocalEnd(label=_("To (empty: until further notice)"), required=False)
    why = forms.ChoiceField(label=_("Reason"), choices=OutOfService.Why.choices)
    note = forms.CharField(label=_("Note"), max_length=200, required=False)

    def __init__(self, *args: Any, robots: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._chosen = {robot.slug: [robot] for robot in robots}
        names = [(robot.slug, robot.name) for robot in robots]
        for group in RobotGroup.objects.prefetch_related("robots"):
            members = list(group.robots.all())
            if members and all(robot.slug in self._chosen for robot in members):
                self._chosen[f"group:{group.slug}"] = members
                names.append((f"group:{group.slug}", group.name))
        cast(forms.ChoiceField, self.fields["robots"]).choices = names

    def clean_robots(self) -> list[Robot]:
        """Return the robots that were chosen."""
        return self._chosen[self.cleaned_data["robots"]]

    def clean(self) -> dict[str, Any]:
        """Check that the period ends after it begins."""
        values: dict[str, Any] = super().clean() or self.cleaned_data
        if values.get("starts_at") and values.get("ends_at") and values["ends_at"] <= values["starts_at"]:
            raise ValidationError(_("The period ends before it begins: exchange the two times."))
        return values


class RobotField(forms.ModelChoiceField):  # type: ignore[type-arg]
    """A robot by its slug.

    The query is hand-written for speed, because fifty people may try to book one slot at the same moment.
    """

    visible: Collection[UUID] | None = ()  # keys of the robots to choose from; None: all robots

    def to_python(self, value: Any) -> Robot | None:
        """Return the robot. Raises `ValidationError` like Django's own field."""
        if value in self.empty_values:
            return None
        self.validate_no_null_characters(value)
        for robot in rows.models(Robot, "SELECT * FROM robots_robot WHERE slug = %s", [value]):
            if self.visible is None or robot.pk in self.visible:
                return robot
        raise ValidationError(self.error_messages["invalid_choice"], "invalid_choice", {"value": value})


class SlotForm(forms.Form):
    """A robot and a slot; also the course, if a person has several.

    Supervisors may also book for another person. People who manage a robot may book against its policy.
    `kept`: begin and end of the booking that is changed.
    """

    robot = RobotField(Robot.objects.none(), label=_("Robot"), to_field_name="slug", empty_label=None)
    starts_at = LocalTime(label=_("From"))
    ends_at = LocalEnd(label=_("To"))
    purpose = forms.CharField(label=_("Purpose (optional)"), max_length=120, required=False)
    course = forms.ModelChoiceField(
        Course.objects.none(),
        label=_("Counts for"),
        to_field_name="slug",
        required=False,
        empty_label=_("the first course with time left"),
    )
    person = forms.CharField(label=_("For another person: their user name"), required=False)
    override = forms.CharField(label=_("Reason to book against the policy"), max_length=200, required=False)
    lesson_of = forms.ModelChoiceField(
        Course.objects.none(),
        label=_("For the course"),
        to_field_name="slug",
        required=False,
        empty_label=_("no course"),
    )
    team = forms.CharField(
        label=_("Together with (up to three user names, with commas; they are asked)"),
        max_length=500,
        required=False,
    )
    turn_min = forms.IntegerField(
        label=_("Minutes per turn (empty: no turns)"), min_value=1, max_value=MOST_TURN_MIN, required=False
    )
    record = RecordField()
    SHARING = ("lesson_of", "team", "turn_min")

    def __init__(
        self,
        *args: Any,
        visible: Collection[UUID] | None,
        supervises: bool,
        overrides: bool,
        courses: Any = (),
        kept: tuple[datetime | None, datetime | None] = (None, None),
        teaches: Any = (),
        **options: Any,
    ) -> None:
        super().__init__(*args, **options)
        if teaches:
            cast(forms.ModelChoiceField, self.fields["lesson_of"]).queryset = teaches  # type: ignore[type-arg]
        else:
            del self.fields["lesson_of"]
        if courses:
            cast(forms.ModelChoiceField, self.fields["course"]).queryset = courses  # type: ignore[type-arg]
        else:
            del self.fields["course"]
        for name, moment in zip(("starts_at", "ends_at"), kept, strict=False):
            cast(LocalTime, self.fields[name]).kept = moment
        choice = cast(RobotField, self.fields["robot"])
        choice.visible = visible
        choice.queryset = Robot.objects.all() if visible is None else Robot.objects.filter(pk__in=visible)
        if not supervises:
            del self.fields["person"]
        if not overrides:
            del self.fields["override"]

    @property
    def usernames(self) -> list[str]:
        """Return the user names of a team."""
        return [name.strip() for name in self.cleaned_data.get("team", "").split(",") if name.strip()]

    @property
    def slot(self) -> Slot:
        """Return the slot of a valid form."""
        return Slot(self.cleaned_data["starts_at"], self.cleaned_data["ends_at"])

    @property
    def choices(self) -> list[tuple[Robot, Slot]]:
        """Return the slots from which a person chooses who typed a time that comes twice."""
        robot, moments = self.cleaned_data.get("robot"), []
        for name in ("starts_at", "ends_at"):
            [error] = self.errors.as_data().get(name, [None])
            typed = self.cleaned_data.get(name)
            moments.append(error.moments if isinstance(error, TwiceError) else [typed] if typed else [])
        if robot is None or not any(len(one) > 1 for one in moments):
            return []
        return [(robot, Slot(starts, ends)) for starts, ends in product(*moments) if starts < ends]
