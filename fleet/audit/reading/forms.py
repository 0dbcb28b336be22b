"""Filters of the log's lists."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import Any, cast
from uuid import UUID

from django import forms
from django.core.exceptions import ValidationError
from django.urls import reverse
from django.utils.translation import gettext_lazy as _
from msgspec.structs import replace

from fleet.audit.integrity.canonical import NO_ROBOT
from fleet.audit.kinds import KINDS, grouped
from fleet.audit.models import Actor, Chain
from fleet.audit.reading import wording
from fleet.audit.reading.listing import CONSOLE, Wanted, outcomes_of, with_ends, without_ends
from fleet.audit.reading.search import words_of
from fleet.base import zones

ANY = [("", _("any"))]
THE_CONSOLE = _("the console itself")
MOST_NAMED = 5


class PersonField(forms.CharField):
    """A person, entered as a name, as a unique part of a name, or (in links) as an identifier.

    Shown as a name.
    """

    def prepare_value(self, value: Any) -> Any:
        """Return the name for an identifier."""
        if value == CONSOLE:
            return str(THE_CONSOLE)
        return (
            Actor.objects.filter(pk=value).values_list("name", flat=True).first() or value if value else value
        )

    def clean(self, value: Any) -> str:
        """Return the identifier.

        Raises `ValidationError` if nobody, or more than one person, has this name.
        """
        typed: str = super().clean(value)
        if not typed or typed == CONSOLE or _is_identifier(typed):
            return typed
        if typed.casefold() == str(THE_CONSOLE).casefold():
            return CONSOLE
        found = people_named(typed, MOST_NAMED + 1)
        exact = [pk for pk, name in found if name.casefold() == typed.casefold()]
        if len(exact) == 1 or len(found) == 1:
            return (exact or [found[0][0]])[0]
        if not found:
            raise ValidationError(_("Nobody in the log has this name."))
        names = ", ".join(name for _pk, name in found[:MOST_NAMED])
        raise ValidationError(_("Several people have this name: %(names)s."), params={"names": names})


class FilterForm(forms.Form):
    """The filters. They are in the URL of the page, so that people can send a link to a filtered list.

    `kinds` are the kinds of the list (None: all); `without` are the filters that it does not show.
    """

    q = forms.CharField(label=_("Said"), max_length=200, required=False)
    since = forms.DateField(label=_("From"), required=False)
    until = forms.DateField(label=_("To"), required=False)
    robot = forms.ChoiceField(label=_("Robot"), required=False)
    person = PersonField(label=_("Person"), required=False)
    kind = forms.ChoiceField(label=_("What"), required=False)
    outcome = forms.ChoiceField(label=_("Outcome"), required=False)
    viewings = forms.BooleanField(label=_("With viewings of cameras"), required=False)
    session = forms.UUIDField(required=False, widget=forms.HiddenInput)

    def __init__(
        self,
        asked: Any,
        *,
        kinds: Sequence[str] | None,
        without: Sequence[str] = (),
        outcomes_are: Any = None,
    ) -> None:
        super().__init__(asked, label_suffix="")
        self.fields["q"].widget = forms.TextInput(attrs={"type": "search", "autocomplete": "off"})
        for name in ("since", "until"):
            self.fields[name].widget = forms.DateInput(attrs={"type": "date"}, format="%Y-%m-%d")
        listed = list(KINDS if kinds is None else kinds)
        self.offer("robot", _robots())
        self.fields["person"].widget = forms.TextInput(
            attrs={"type": "search", "autocomplete": "off", "data-people": reverse("admin:audit_people")}
        )
        groups = grouped(without_ends(listed))
        self.offer(
            "kind", [(name, [(kind, wording.label(kind)) for kind in found]) for name, found in groups]
        )
        outcomes = dict.fromkeys(outcome for _kind, outcome in outcomes_of(with_ends(listed)))
        self.offer("outcome", sorted((outcome, wording.outcome(outcome)) for outcome in outcomes))
        if outcomes_are is not None:
            self.fields["outcome"].label = outcomes_are
        for name in [*without, *([] if kinds is None else ["viewings"])]:
            del self.fields[name]

    def clean(self) -> dict[str, Any]:
        """Refuse a first day that is after the last day."""
        asked: dict[str, Any] = super().clean() or self.cleaned_data
        since, until = asked.get("since"), asked.get("until")
        if since and until and since > until:
            raise ValidationError(_("The first day is after the last."))
        return asked

    def wanted(self) -> Wanted:
        """Return the filters of a valid form."""
        asked, zone = self.cleaned_data, zones.viewers().key
        return Wanted(
            words=words_of(asked.get("q", "")),
            since=asked["since"],
            until=asked["until"],
            robot=UUID(asked["robot"]) if asked["robot"] else None,
            person=asked["person"],
            kind=asked.get("kind", ""),
            outcome=asked.get("outcome", ""),
            session=asked.get("session"),
            zone=zone if (asked["since"] or asked["until"]) and zone != zones.UTC_ZONE else "",
        )

    def listed(self) -> Wanted:
        """Return `wanted` for a list: viewings of cameras would fill it. Exports and lists of a session have them."""
        wanted = self.wanted()
        has_viewings = wanted.session or self.cleaned_data.get("viewings", True)
        return replace(wanted, without_viewings=not has_viewings)

    @property
    def is_filtered(self) -> bool:
        return any(self.data.get(name) for name in self.fields)

    def offer(self, name: str, choices: Sequence[tuple[Any, Any]]) -> None:
        """Set the choices of a field: these, or none."""
        cast(forms.ChoiceField, self.fields[name]).choices = [*ANY, *choices]


def _robots() -> list[tuple[str, Any]]:
    robots = Chain.objects.exclude(pk=NO_ROBOT).order_by("name")
    return [*((str(robot.pk), str(robot)) for robot in robots), (str(NO_ROBOT), _("none"))]


def _is_identifier(typed: str) -> bool:
    with suppress(ValueError):
        return str(UUID(typed)) == typed
    return Actor.objects.filter(pk=typed).exists()


def people_named(part: str, most: int) -> list[tuple[str, str]]:
    """Return at most `most` people whose name contains `part`: identifier and name."""
    return list(Actor.objects.filter(name__icontains=part).order_by("name").values_list("pk", "name")[:most])
