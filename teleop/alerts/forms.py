"""The form of one rule of alerts."""

from __future__ import annotations

from typing import Any

from django import forms
from django.core.exceptions import ValidationError
from django.core.validators import validate_email
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy

from teleop.alerts.kinds import KINDS
from teleop.models import AlertRule


class RuleForm(forms.ModelForm):  # type: ignore[type-arg]  # not subscriptable at run time
    """The form of the readers of a kind of alert, and of its times."""

    class Meta:
        model = AlertRule
        fields = ["active", "after_min", "again_h", "mail", "to", "quiet_from", "quiet_until"]
        widgets = {
            "to": forms.Textarea(attrs={"rows": 1, "placeholder": gettext_lazy("all staff")}),
            "quiet_from": forms.TimeInput(attrs={"type": "time"}, format="%H:%M"),
            "quiet_until": forms.TimeInput(attrs={"type": "time"}, format="%H:%M"),
        }

    @property
    def label(self) -> Any:
        """Return the kind in words."""
        return KINDS[self.instance.kind].label

    def clean_to(self) -> str:
        """Return the addresses; raise `ValidationError` for a word that is none."""
        for word in AlertRule(to=self.cleaned_data["to"]).addresses:
            try:
                validate_email(word)
            except ValidationError:
                raise ValidationError(_("%s is no e-mail address.") % word) from None
        return str(self.cleaned_data["to"])

    def clean(self) -> dict[str, Any]:
        """Raise `ValidationError` if only one end of the quiet times is given."""
        values: dict[str, Any] = super().clean() or self.cleaned_data
        if (values.get("quiet_from") is None) != (values.get("quiet_until") is None):
            raise ValidationError(_("Quiet times have a begin and an end."))
        return values
