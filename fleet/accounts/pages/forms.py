"""Forms of a person's own pages."""

from __future__ import annotations

from typing import Any, cast

from django import forms
from django.conf import settings
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy

from fleet.base import zones

PANELS = ("chart", "motions", "phrases")  # panels of the control page on a desktop screen
PLACES = ("left", "top", "bottom")


class PageChoicesForm(forms.Form):
    """The choices that the control page stores for a person; a request may contain only some of them.

    `kept` contains the valid choices: `panels` (the place of each panel) and `hints_seen`.
    """

    chart = forms.ChoiceField(choices=[(place, place) for place in PLACES], required=False)
    motions = forms.ChoiceField(choices=[(place, place) for place in PLACES], required=False)
    phrases = forms.ChoiceField(choices=[(place, place) for place in PLACES], required=False)
    hints_seen = forms.NullBooleanField()

    kept: dict[str, Any]

    def clean(self) -> dict[str, Any]:
        """Refuse two panels at one place, a missing panel, and a request without any choice."""
        fields = super().clean() or {}
        places = {panel: place for panel in PANELS if (place := fields.get(panel))}
        self.kept = {}
        if places:
            if sorted(places.values()) != sorted(PLACES):
                raise forms.ValidationError(_("Each panel needs a place of its own."))
            self.kept["panels"] = places
        if fields.get("hints_seen") is not None:
            self.kept["hints_seen"] = fields["hints_seen"]
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
