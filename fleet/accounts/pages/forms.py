"""Forms of a person's own pages."""

from __future__ import annotations

from typing import Any, cast

import msgspec
from django import forms
from django.conf import settings
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy

from fleet.accounts.layouts import Layout
from fleet.base import zones
from fleet.base.formats.sentences import in_words
from robots.shared.misfits import misfit_of

FLAGS = ("hints_seen", "sound", "vibration", "speech")


class PageChoicesForm(forms.Form):
    """The choices that the control page stores for a person; a request may contain only some of them.

    `kept` contains the valid choices: each of `FLAGS` (whether the hints were read, and how the page signals a stop),
    and a robot's layout (JSON of a `Layout`), under the name that the page reads.
    """

    hints_seen = forms.NullBooleanField()
    sound = forms.NullBooleanField()
    vibration = forms.NullBooleanField()
    speech = forms.NullBooleanField()
    robot = forms.SlugField(max_length=50, required=False)
    layout = forms.CharField(max_length=2000, required=False)

    kept: dict[str, Any]

    def clean(self) -> dict[str, Any]:
        """Refuse what is no layout, and a request without any choice."""
        fields = super().clean() or {}
        self.kept = {flag: fields[flag] for flag in FLAGS if fields.get(flag) is not None}
        if fields.get("robot") and fields.get("layout"):
            try:
                msgspec.json.decode(fields["layout"], type=Layout)
            except msgspec.DecodeError as error:
                raise forms.ValidationError(in_words(misfit_of(error))) from error
            self.kept[f"layout {fields['robot']}"] = {"layout": fields["layout"]}
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
