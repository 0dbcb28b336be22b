"""People in the admin."""

from __future__ import annotations

from typing import Any
from urllib.parse import urlencode

from allauth.account.models import EmailAddress
from allauth.mfa.models import Authenticator
from allauth.socialaccount.models import SocialAccount, SocialApp, SocialToken
from django.contrib import admin, messages
from django.contrib.admin.utils import unquote
from django.contrib.auth.admin import UserAdmin
from django.contrib.auth.models import Group
from django.db import transaction
from django.db.models import QuerySet
from django.forms import ModelForm, Select
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect
from django.urls import reverse
from django.utils.html import format_html
from django.utils.translation import gettext_lazy as _

from fleet import zones
from fleet.accounts import services
from fleet.accounts.models import SignIn, User
from fleet.accounts.requests import person_of
from fleet.accounts.sign_in import second_factor
from fleet.audit.admin import ReadOnly
from fleet.audit.recorded_admin import RecordedAdmin

# Roles are given robot by robot, and staff may do everything: groups would be a second truth. The other tables are
# django-allauth's: people change their own second factor and address, and settings name the single sign-on.
admin.site.unregister([Group, EmailAddress, Authenticator, SocialAccount, SocialApp, SocialToken])


class ListedLookups(RecordedAdmin):
    """Lists that an address can filter only by the offered filters.

    Django lets them filter by every column and by the keys of what refers to it, also by their beginning: who may
    see a list could find out other people's session keys character by character.
    """

    def lookup_allowed(self, lookup: str, value: str, request: HttpRequest | None = None) -> bool:
        """Return whether an address may filter by this."""
        return lookup in {f"{name}__exact" for name in self.list_filter}


@admin.register(User)
class PersonAdmin(ListedLookups, UserAdmin):  # type: ignore[type-arg]  # not subscriptable at run time
    """Accounts. They are never deleted, because the audit log refers to them: clear "active" instead."""

    list_display = ["username", "full_name", "email", "is_staff", "is_active", "last_login"]
    list_filter = ["is_staff", "is_active"]
    search_fields = ["username", "full_name", "email"]
    readonly_fields = ["project", "roles", "second_factor", "last_login", "date_joined"]
    actions = ["remove_second_factors"]
    filter_horizontal = []
    fieldsets = [
        (None, {"fields": ["username", "password", "full_name", "email", "second_factor", "time_zone"]}),
        (_("Rights"), {"fields": ["project", "is_active", "is_staff", "roles"]}),
        (_("Dates"), {"fields": ["last_login", "date_joined"]}),
    ]
    add_fieldsets = [
        (None, {"fields": ["username", "full_name", "email", "usable_password", "password1", "password2"]})
    ]

    @admin.display(description=_("Roles on robots"))
    def roles(self, user: User) -> str:
        """A link to the person's roles."""
        query = urlencode({"user__id__exact": str(user.pk)})
        url = reverse("admin:robots_robotrole_changelist")
        return format_html('<a href="{}?{}">{}</a>', url, query, _("Show"))

    @admin.display(description=_("Second factor"), boolean=True)
    def second_factor(self, user: User) -> bool:
        """Return whether the person signs in with a second factor."""
        return second_factor.has_second_factor(user)

    @admin.action(description=_("Remove the second factor, since phone and codes are lost"))
    def remove_second_factors(self, request: HttpRequest, people: QuerySet[User]) -> None:
        """Let these people sign in by password again. Each removal is recorded."""
        count = sum(second_factor.second_factors_remove(person) > 0 for person in people)
        self.message_user(request, _("Second factors removed: %d.") % count, messages.SUCCESS)

    def formfield_for_dbfield(self, db_field: Any, request: HttpRequest, **options: Any) -> Any:
        """A time zone is chosen from the known ones."""
        if db_field.name == "time_zone":
            options["widget"] = Select(
                choices=[("", _("the lab's")), (zones.UTC, zones.UTC), *zones.choices()]
            )
        return super().formfield_for_dbfield(db_field, request, **options)

    def get_object(self, request: HttpRequest, object_id: str, from_field: str | None = None) -> User | None:
        """An account to look at or to change, and who would change it."""
        person = super().get_object(request, object_id, from_field)
        if person is not None:
            person.changed_by = person_of(request)
        return person

    def save_model(self, request: HttpRequest, obj: User, form: ModelForm[User], change: bool) -> None:
        """Save, as the person who is signed in; also a new account."""
        obj.changed_by = person_of(request)
        super().save_model(request, obj, form, change)

    def user_change_password(self, request: HttpRequest, id: str, form_url: str = "") -> HttpResponse:
        """Change a person's password: their sign-ins and tokens end.

        A person who changes their own password stays signed in here. A service account gets none: it signs in by
        tokens only.
        """
        with transaction.atomic():
            before = self.get_object(request, unquote(id))
            if before and before.project:
                self.message_user(
                    request, _("A service account has tokens, and no password."), messages.ERROR
                )
                return redirect("person", before.pk)
            response = super().user_change_password(request, id, form_url)
            after = self.get_object(request, unquote(id))
            if before and after and before.password != after.password:
                if before == request.user:
                    services.own_password_changed(request, after)
                else:  # signals ended them; Django gave this session a new key
                    services.sign_in_begun(request, person_of(request))
                    notice = _(
                        "The person is signed out everywhere, and the tokens of their programs are ended."
                    )
                    self.message_user(request, notice, messages.INFO)
        return response

    def has_delete_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        """Accounts are closed, not deleted."""
        return False


@admin.register(SignIn)
class SignInAdmin(ListedLookups, ReadOnly):
    """Present sign-ins and their origin, read only. Closing an account ends its sign-ins."""

    list_display = ["user", "address", "device", "started_at", "seen_at"]
    fields = ["user", "address", "user_agent", "started_at", "seen_at"]
    search_fields = ["user__username", "user__full_name", "address"]
    list_select_related = ["user"]

    @admin.display(description=_("browser"))
    def device(self, sign_in: SignIn) -> str:
        """The browser's own description, in plain words."""
        return sign_in.device
