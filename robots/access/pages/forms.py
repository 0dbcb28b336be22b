"""Forms of courses, people, robot groups, qualifications and tokens."""

from __future__ import annotations

import hashlib
from codecs import BOM_UTF8
from contextlib import suppress
from datetime import date, datetime, time, timedelta
from decimal import Decimal
from typing import Any
from uuid import UUID, uuid4

import msgspec
from django import forms
from django.contrib.auth.forms import BaseUserCreationForm
from django.core.exceptions import ValidationError
from django.db.models import Q
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy
from msgspec import structs

from fleet.accounts.models import User
from fleet.accounts.names import AccountNames
from fleet.accounts.tokens.models import Scope
from fleet.base.formats.dates import dated
from fleet.base.names import require
from fleet.base.web.kept_files import KeptFileForm
from robots.access.claiming import namesake
from robots.access.models import Course, Qualification, RobotGroup
from robots.access.people_lists.columns import Role
from robots.access.people_lists.encodings import ENCODINGS, Decoded, NotInEncodingError, decoded
from robots.access.people_lists.reading import PeopleList, read_people
from robots.access.people_lists.workbooks import START as WORKBOOK
from robots.access.people_lists.workbooks import NoWorkbookError, Workbook, read_workbook
from robots.access.selectors import lab_date, people_of
from robots.registry.models import Robot
from robots.registry.selectors import free_slug

FILE_BYTES = 1_500_000  # 5,000 lines of 300 letters; the preview repeats a file within Django's 2.5 MB
# In small letters: .ods; .xls; pages and XML that programs write as .xls; .pdf; .rtf
NO_LIST_STARTS = (
    b"pk\x03\x04",
    b"\xd0\xcf\x11\xe0",
    b"<html",
    b"<!doctype",
    b"<table",
    b"<?xml",
    b"%pdf",
    b"{\\rtf",
)
_NO_LIST = gettext_lazy(
    "This is no CSV file and no workbook (.xlsx). Open it in a spreadsheet program, save it as CSV, and choose that "
    "file."
)
SEPARATORS = {
    ",": gettext_lazy("comma"),
    ";": gettext_lazy("semicolon"),
    "\t": gettext_lazy("tab"),
    "|": gettext_lazy("vertical bar"),
}
ROLES = [
    (Role.NAME.value, gettext_lazy("whole name")),
    (Role.LAST_FIRST.value, gettext_lazy("last name, first name")),
    (Role.FIRST_NAME.value, gettext_lazy("first name")),
    (Role.LAST_NAME.value, gettext_lazy("last name")),
    (Role.EMAIL.value, gettext_lazy("e-mail address")),
    (Role.NUMBER.value, gettext_lazy("student number")),
    (Role.UNUSED.value, gettext_lazy("not used")),
]
HOURS = {"week_hours": "week_min", "day_hours": "day_min", "course_week_hours": "course_week_min"}
_CHOICES = forms.CheckboxSelectMultiple


def _day_input(**attrs: Any) -> forms.DateInput:
    return forms.DateInput(attrs={"type": "date", **attrs}, format="%Y-%m-%d")


def end_of(day: date | None) -> datetime | None:
    """Return the end of a day in the lab's time zone."""
    if day is None:
        return None
    return datetime.combine(day + timedelta(days=1), time(), tzinfo=timezone.get_default_timezone())


class PeopleForm(KeptFileForm):
    """A list of people, as text or as a file. `clean` reads the list into `people_list`.

    The preview asks in `encoding`, `separator` and `column` (one value for each column) how to read it.
    """

    people = forms.CharField(
        label=gettext_lazy("People"),
        required=False,
        strip=False,
        max_length=FILE_BYTES,
        help_text=gettext_lazy("One per line: Ada Lovelace <ada@example.org>, or as in a table."),
        widget=forms.Textarea(attrs={"rows": 6, "spellcheck": "false"}),
    )
    file = forms.FileField(
        label=gettext_lazy("or a file (CSV, .xlsx) with names, and e-mail addresses or student numbers"),
        required=False,
        help_text=gettext_lazy(
            "You see how each line is read, and may change encoding, separator and columns."
        ),
        widget=forms.FileInput(attrs={"accept": ".csv,.tsv,.txt,.xlsx,text/csv,text/plain"}),
    )
    encoding = forms.ChoiceField(
        label=gettext_lazy("Encoding"), required=False, choices=[("", ""), *ENCODINGS.items()]
    )
    separator = forms.ChoiceField(
        label=gettext_lazy("Separator"),
        required=False,
        choices=[("", gettext_lazy("none")), *SEPARATORS.items()],
    )
    column = forms.TypedMultipleChoiceField(required=False, choices=ROLES, coerce=Role, empty_value=[])

    most_bytes = FILE_BYTES
    people_list = PeopleList()
    decoded: Decoded | None = None  # None: the list was pasted
    workbook: Workbook | None = None
    encoding_fault = ""  # why the chosen encoding was not used

    def clean(self) -> dict[str, Any]:
        values = super().clean()
        typed, how = values.get("people", ""), self._how(values)
        if values.get("file") is not None:
            how = {}  # another file is read afresh
        content = self.kept.content if self.kept else b""
        with suppress(NoWorkbookError):
            self.workbook = read_workbook(content) if content.startswith(WORKBOOK) else None
        if self.workbook is not None:
            content, typed, how = b"", self.workbook.text, {**how, "separator": "\t"}
        if _is_no_list(content):
            self.kept, content = None, b""
            self.add_error("file", _NO_LIST)
        if content:
            self._decode(content, "" if values.get("file") is not None else values.get("encoding", ""))
        text = self.decoded.text if self.decoded else typed
        self.people_list = read_people(text, **how) if text.strip() else PeopleList()
        if (self.kept or typed.strip()) and self.people_list.is_empty:
            self.add_error(None, _("There is nobody in the list."))
        if self.workbook is not None and self.workbook.sheets > 1:
            notes = (_("Only the first sheet of the workbook is read."), *self.people_list.notes)
            self.people_list = structs.replace(self.people_list, notes=notes)
        if (self.decoded or self.workbook) and values.get("people", "").strip():
            notes = (_("The pasted list is not used: the file is."), *self.people_list.notes)
            self.people_list = structs.replace(self.people_list, notes=notes)
        return values

    def _decode(self, content: bytes, encoding: str) -> None:
        try:
            self.decoded = decoded(content, encoding)
        except NotInEncodingError as error:
            self.encoding_fault = str(error)
            self.decoded = decoded(content)

    def _how(self, values: dict[str, Any]) -> dict[str, Any]:
        """Return how to read the list, as chosen in the preview.

        The roles of columns count only for the same separator and encoding: others may give other titles.
        """
        separator = values.get("separator", "")
        now = (separator, values.get("encoding", ""))
        same = now == (self.data.get("separator_before"), self.data.get("encoding_before", ""))
        return {"separator": separator, "roles": values.get("column", []) if same else []}

    def repeat(self, **read: str | list[str]) -> None:
        """Show the form with its file, and with how the list was read, for the fields of the preview."""
        super().repeat(
            encoding=self.decoded.encoding if self.decoded else "",
            separator=self.people_list.separator,
            column=[column.role.value for column in self.people_list.columns],
            **read,
        )


def _is_no_list(content: bytes) -> bool:
    return content[:200].removeprefix(BOM_UTF8).lstrip().lower().startswith(NO_LIST_STARTS)


def digest(people: PeopleList) -> str:
    """Return a hash of a list, which shows whether the list is still the one of the preview."""
    return hashlib.sha256(msgspec.json.encode(people.people)).hexdigest()[:24]


class EnrolForm(PeopleForm):
    """People for a course that exists."""

    def clean(self) -> dict[str, Any]:
        values = super().clean()
        if not self.errors and self.people_list.is_empty:
            raise ValidationError(_("Paste a list or choose a file."))
        return values


class CourseForm(PeopleForm, forms.ModelForm):  # type: ignore[type-arg]
    """A course; a new course with its people. People type quotas in hours, supervisors by user name or e-mail."""

    supervisors = forms.CharField(
        label=gettext_lazy("Supervisors"),
        required=False,
        max_length=2000,
        help_text=gettext_lazy(
            "User names or e-mail addresses, with commas. Supervisors enrol people, grant qualifications, and may take "
            "over control."
        ),
        widget=forms.TextInput(attrs={"autocapitalize": "none", "spellcheck": "false"}),
    )
    week_hours, day_hours, course_week_hours = (
        forms.DecimalField(
            label=label,
            required=False,
            min_value=Decimal("0.25"),
            max_value=most,
            widget=forms.NumberInput(attrs={"step": "0.25", "inputmode": "decimal"}),
        )
        for label, most in (
            (gettext_lazy("Hours per person and week"), 168),
            (gettext_lazy("Hours per person and day"), 24),
            (gettext_lazy("Hours per week for the whole course"), 168000),
        )
    )

    class Meta:
        model = Course
        fields = ["name", "robots", "groups", "role", "starts_on", "ends_on", "at_once"]
        fields += ["lessons_count", "record_lessons"]
        widgets = {
            "name": forms.TextInput(attrs={"autocomplete": "off"}),
            "robots": _CHOICES,
            "groups": _CHOICES,
            "starts_on": _day_input(),
            "ends_on": _day_input(),
        }

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        course = self.instance
        self.fields["lessons_count"].required = False
        if course.pk is None:
            self.initial.setdefault("starts_on", lab_date())
        else:
            for name in PeopleForm.base_fields:
                del self.fields[name]
            self.initial["supervisors"] = ", ".join(
                course.supervisors.order_by("username").values_list("username", flat=True)
            )
            for hours, minutes in HOURS.items():
                value = getattr(course, minutes)
                self.initial[hours] = value and (Decimal(value) / 60).normalize().to_eng_string()

    def clean_supervisors(self) -> list[User]:
        """Return the people; refuse a name that is not the name of exactly one open account."""
        found = []
        for name in filter(None, map(str.strip, self.cleaned_data["supervisors"].split(","))):
            users = User.objects.filter(Q(username=name) | Q(email__iexact=name), is_active=True)[:2]
            if len(users) != 1:
                raise ValidationError(_("%s is not the name of one open account.") % name)
            found.append(users[0])
        return found

    def clean(self) -> dict[str, Any]:
        """Set the fields that people do not type: the slug, and the quotas in minutes."""
        values = super().clean()
        for hours, minutes in HOURS.items():
            typed = values.get(hours)
            setattr(self.instance, minutes, None if typed is None else round(typed * 60))
        if not self.instance.slug and values.get("name"):
            self.instance.slug = free_slug(Course, values["name"])
        if not self.errors and not values.get("robots") and not values.get("groups"):
            raise ValidationError(_("Choose at least one robot or group."))
        return values


class ActionForm(forms.Form):
    """A change for chosen people of a course. Its supervisors get qualifications, also those who are not enrolled."""

    person = forms.ModelMultipleChoiceField(User.objects.none(), required=False)
    everybody = forms.BooleanField(label=gettext_lazy("Everybody in the course"), required=False)
    qualification = forms.ModelChoiceField(
        Qualification.objects.none(),
        label=gettext_lazy("Qualification"),
        required=False,
        empty_label=None,
        to_field_name="slug",
    )
    until = forms.DateField(
        label=gettext_lazy("Valid until (empty: for good)"), required=False, widget=_day_input()
    )

    def __init__(self, *args: Any, course: Course, qualifications: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._inside = User.objects.filter(enrolments__course=course)
        of_qualification = self.data.get("action") in ("grant", "revoke")
        self.fields["person"].queryset = people_of(course) if of_qualification else self._inside  # type: ignore[attr-defined]
        self.fields["qualification"].queryset = qualifications  # type: ignore[attr-defined]

    def clean_until(self) -> date | None:
        """Return the last day; refuse a day that is over, or more than 50 years ahead."""
        day: date | None = self.cleaned_data["until"]
        if day is not None and day < lab_date():
            raise ValidationError(_("This day is over: choose a later one."))
        if day is not None and day.year > lab_date().year + 50:
            raise ValidationError(_("This day is too far ahead: look at the year."))
        return day

    def clean(self) -> dict[str, Any]:
        """Return the values with `people`; refuse if nobody is chosen."""
        values: dict[str, Any] = super().clean() or self.cleaned_data
        people = self._inside if values.get("everybody") else values.get("person", ())
        values["people"] = list(people)
        if not self.errors and not values["people"]:
            raise ValidationError(_("Choose people first."))
        return values


class InvitationForm(forms.Form):
    last_day = forms.DateField(label=gettext_lazy("Valid until"), widget=_day_input())
    most_uses = forms.IntegerField(
        label=gettext_lazy("People at most"), min_value=1, max_value=5000, initial=40
    )

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.initial.setdefault("last_day", lab_date() + timedelta(days=7))

    def clean_last_day(self) -> date:
        """Return the last day; refuse a day that is over, or more than a year ahead."""
        day: date = self.cleaned_data["last_day"]
        if not lab_date() <= day <= lab_date() + timedelta(days=366):
            raise ValidationError(_("Choose a day from today on, within a year."))
        return day


class JoinForm(BaseUserCreationForm):  # type: ignore[type-arg]
    """A person's new account, made by an invitation to `course`. A name of the course's people is asked about."""

    another = forms.BooleanField(required=False)

    class Meta:
        model = User
        fields = ["full_name", "username"]

    def __init__(self, *args: Any, course: Course, **options: Any) -> None:
        super().__init__(*args, **options)
        self.fields["full_name"].required = True
        self._course = course
        self.asks = False  # whether it is another person of the same name

    def clean(self) -> dict[str, Any]:
        """Refuse a second account of a person of the course."""
        values: dict[str, Any] = super().clean() or self.cleaned_data
        self.asks = namesake(self._course, values.get("full_name", ""))
        if self.asks and not values.get("another"):
            text = _(
                "Somebody of this name is in the course already. If it is you, sign in, or set the password of the "
                "account that the course’s list made for you."
            )
            raise ValidationError(text, code="namesake")
        return values

    def clean_username(self) -> str:
        """Return the name; refuse a name that an account has (upper and lower case count as the same), or with @."""
        username: str = self.cleaned_data["username"]
        if "@" in username:  # it could be the e-mail address by which staff name another person
            raise ValidationError(_("Choose a user name without @."))
        if User.objects.filter(username__iexact=username).exists():
            raise ValidationError(_("Another account has this user name: choose another one, or sign in."))
        return username


class _EntryForm(forms.ModelForm):  # type: ignore[type-arg]
    """An entry whose slug is made from its name."""

    def clean(self) -> dict[str, Any]:
        """Set the slug of a new entry."""
        values: dict[str, Any] = super().clean() or self.cleaned_data
        if not self.instance.slug and values.get("name"):
            self.instance.slug = free_slug(type(self.instance), values["name"])
        return values


class GroupForm(_EntryForm):
    class Meta:
        model = RobotGroup
        fields = ["name", "robots"]
        widgets = {"robots": _CHOICES}


class QualificationForm(_EntryForm):
    """A qualification and the robots that demand it."""

    class Meta:
        model = Qualification
        fields = ["name", "description", "robots", "groups"]
        widgets = {"robots": _CHOICES, "groups": _CHOICES}


class TokenForm(forms.Form):
    """A new token. `once` is the token's id: a form that is sent twice makes one token."""

    name = forms.CharField(
        label=gettext_lazy("Name of the program"),
        max_length=40,
        help_text=gettext_lazy(
            "Such as night-tests. Others see it beside the name while the program drives."
        ),
        widget=forms.TextInput(
            attrs={"autocomplete": "off", "autocapitalize": "none", "spellcheck": "false"}
        ),
    )
    scopes = forms.MultipleChoiceField(
        label=gettext_lazy("The program may"),
        choices=Scope.choices,
        initial=[Scope.READ.value],
        widget=_CHOICES,
        error_messages={"required": gettext_lazy("Choose at least one.")},
    )
    robots = forms.ModelMultipleChoiceField(
        Robot.objects.none(),
        label=gettext_lazy("Only these robots"),
        required=False,
        to_field_name="slug",
        widget=_CHOICES,
    )
    days = forms.TypedChoiceField(label=gettext_lazy("Valid for"), coerce=int, initial="90")
    once = forms.UUIDField(widget=forms.HiddenInput, initial=uuid4)

    def __init__(self, *args: Any, robots: Any, taken: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._taken = taken
        self.fields["robots"].queryset = robots  # type: ignore[attr-defined]
        self.fields["days"].choices = [  # type: ignore[attr-defined]
            (str(days), _("%(days)s, until %(day)s") % {"days": words, "day": _day_after(days)})
            for days, words in (
                (1, _("1 day")),
                (7, _("1 week")),
                (30, _("30 days")),
                (90, _("90 days")),
                (180, _("180 days")),
                (365, _("1 year")),
            )
        ]

    def clean_name(self) -> str:
        """Return the name in one line; refuse the name of another token of this person."""
        require(self.cleaned_data["name"])
        name = " ".join(self.cleaned_data["name"].split())
        if self._taken.filter(name=name).exclude(pk=_uuid_or_none(self.data.get("once"))).exists():
            raise ValidationError(_("There is a token with this name: choose another one, or end that one."))
        return name


def _day_after(days: int) -> str:
    return dated(timezone.localtime(timezone.now() + timedelta(days=days)), "j M Y")


def _uuid_or_none(text: Any) -> UUID | None:
    try:
        return UUID(str(text))
    except ValueError:
        return None


class ServiceAccountForm(forms.Form):
    name = forms.CharField(
        label=gettext_lazy("Name"),
        max_length=80,
        help_text=gettext_lazy("The name that people see while the account drives, such as Night tests."),
        widget=forms.TextInput(attrs={"autocomplete": "off"}),
    )
    project = forms.CharField(
        label=gettext_lazy("Project"), max_length=80, widget=forms.TextInput(attrs={"autocomplete": "off"})
    )

    def clean_name(self) -> str:
        """Return the name in one line."""
        name = " ".join(self.cleaned_data["name"].split())
        require(self.cleaned_data["name"], AccountNames(User).fault_of_name)
        return name

    def clean_project(self) -> str:
        """Return the project in one line."""
        require(self.cleaned_data["project"])
        return " ".join(self.cleaned_data["project"].split())
