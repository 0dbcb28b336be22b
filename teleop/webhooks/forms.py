"""The form of a new webhook."""

from __future__ import annotations

from typing import Any

from django import forms
from django.core.exceptions import ValidationError
from django.utils.translation import gettext_lazy as _

from fleet.base.names import require
from robots.registry.models import Robot
from robots.shared.wire import NotDone
from teleop.models import Webhook
from teleop.webhooks.addresses import LONGEST, target_of
from teleop.webhooks.events import EVENT_CATEGORIES


class WebhookForm(forms.Form):
    """Name, address, categories of events, and robots."""

    name = forms.CharField(label=_("Name"), max_length=80)
    address = forms.CharField(
        label=_("Address"),
        max_length=LONGEST,
        widget=forms.TextInput(attrs={"inputmode": "url", "spellcheck": "false", "autocomplete": "off"}),
    )
    kinds = forms.MultipleChoiceField(
        label=_("Events"),
        choices=[(name, category.label) for name, category in EVENT_CATEGORIES.items()],
        widget=forms.CheckboxSelectMultiple,
    )
    robots = forms.ModelMultipleChoiceField(
        label=_("Robots"),
        queryset=Robot.objects.none(),
        required=False,
        widget=forms.CheckboxSelectMultiple,
    )
    texts = forms.BooleanField(label=_("With spoken sentences and reasons"), required=False)

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        robots = self.fields["robots"]
        assert isinstance(robots, forms.ModelMultipleChoiceField)  # noqa: S101
        robots.queryset = Robot.objects.all()

    def clean_name(self) -> str:
        """Refuse a name that another webhook has."""
        name: str = self.cleaned_data["name"]
        require(name)
        if Webhook.objects.filter(name=name).exists():
            raise ValidationError(_("Another webhook has this name."), "name_taken")
        return name

    def clean_address(self) -> str:
        """Refuse an address to which no webhook may lead."""
        address: str = self.cleaned_data["address"]
        try:
            target_of(address)
        except NotDone as refused:
            raise ValidationError(refused.refusal.text, refused.refusal.code) from refused
        return address
