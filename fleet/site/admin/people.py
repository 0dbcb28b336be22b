"""Actions on many accounts in the admin that need apps above the accounts."""

from __future__ import annotations

from typing import Any

from django.contrib import admin, messages
from django.db.models import QuerySet
from django.http import HttpRequest, HttpResponseBase
from django.utils.translation import gettext_lazy as _

from fleet.accounts.admin import PersonAdmin
from fleet.accounts.erasing import erasable
from fleet.accounts.models import User
from fleet.accounts.requests import person_of
from fleet.site.pages.people import MOST, ask_to_erase
from teleop.reports.own_data import export_of_many


@admin.action(description=_("Export what the console knows about them"))
def export_people(_admin: Any, request: HttpRequest, people: QuerySet[User]) -> HttpResponseBase:
    """Return their data as a file."""
    return export_of_many(list(people.filter(project="")[:MOST]), actor=person_of(request))


@admin.action(description=_("Erase for good…"))
def erase_people(site: Any, request: HttpRequest, people: QuerySet[User]) -> HttpResponseBase | None:
    """Ask first: the form of that page does it."""
    chosen = erasable(people.filter(project="")[:MOST], person_of(request))
    if not chosen:
        site.message_user(request, _("Nobody can erase themselves, or a service account."), messages.ERROR)
        return None
    return ask_to_erase(request, chosen)


PersonAdmin.actions = [*PersonAdmin.actions, export_people, erase_people]
