"""Forms of a person's own pages."""

from __future__ import annotations

from typing import Any, cast

from django import forms
from django.conf import settings
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy

from fleet.accounts.layouts import check_cells
from fleet.base import zones

PANELS = ("chart", "motions", "phrases")  # panels of the control page on a desktop screen
FLAGS = ("hints_seen", "sound", "vibration", "speech")
PLACES = ("left", "top", "bottom")


class PageChoicesForm(forms.Form):
    """The choices that the control page stores for a person; a request may contain only some of them.

    `kept` contains the valid choices: `panels` (the place of each panel), each of `FLAGS` (whether the hints were
    read, and how the page signals a stop), and a robot's layout and plot, under the name that the page reads.
    """

    chart = forms.ChoiceField(choices=[(place, place) for place in PLACES], required=False)
    motions = forms.ChoiceField(choices=[(place, place) for place in PLACES], required=False)
    phrases = forms.ChoiceField(choices=[(place, place) for place in PLACES], required=False)
    hints_seen = forms.NullBooleanField()
    sound = forms.NullBooleanField()
    vibration = forms.NullBooleanField()
    speech = forms.NullBooleanField()
    robot = forms.SlugField(max_length=50, required=False)
    cells = forms.CharField(max_length=60, required=False)  # separated by commas; blank: the page's own views
    plot = forms.CharField(max_length=500, required=False)  # topic and fields, separated by spaces
    side = forms.ChoiceField(choices=[("true", "true"), ("false", "false")], required=False)

    kept: dict[str, Any]

    def clean(self) -> dict[str, Any]:
        """Refuse two panels at one place, a missing panel, and a request without any choice."""
        fields = super().clean() or {}
        places = {panel: place for panel in PANELS if (place := fields.get(panel))}
        self.kept = {flag: fields[flag] for flag in FLAGS if fields.get(flag) is not None}
        if places:
            if sorted(places.values()) != sorted(PLACES):
                raise forms.ValidationError(_("Each panel needs a place of its own."))
            self.kept["panels"] = places
        if fields.get("robot") and fields.get("side"):
            cells = fields.get("cells", "")
            check_cells(cells.split(",") if cells else [])
            self.kept[f"layout {fields['robot']}"] = {"cells": cells, "side": fields["side"]}
        if fields.get("robot") and fields.get("plot"):
            self.kept[f"plot {fields['robot']}"] = {"plot": fields["plot"]}
        if not self.kept:
            raise forms.ValidationError(_("There is no choice in this request."))
        return fields


class SettingsForm(forms.Form):
    """The choices of a person for themselves."""

    language = forms.ChoiceField(label=gettext_lazy("Language"), required=False)
    time_zone = forms.ChoiceField(label=gettext_lazy("Time zone"), required=False)

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        offered = [("", _("as this browser")), *settings.LANGUAGES]
        cast(forms.ChoiceField, self.fields["language"]).choices = offered
        lab = _("as the lab: %(zone)s") % {"zone": settings.TIME_ZONE}
        cast(forms.ChoiceField, self.fields["time_zone"]).choices = [
            ("", lab),
            (zones.UTC_ZONE, zones.UTC_ZONE),
            *zones.choices(),
        ]
