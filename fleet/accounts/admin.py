"""People in the admin."""

from __future__ import annotations

from typing import Any
from urllib.parse import urlencode

from allauth.account.models import EmailAddress
from allauth.mfa.models import Authenticator
from allauth.socialaccount.models import SocialAccount, SocialApp, SocialToken
from django.conf import settings
from django.contrib import admin, messages
from django.contrib.admin.utils import unquote
from django.contrib.auth.admin import UserAdmin
from django.contrib.auth.forms import AdminPasswordChangeForm
from django.contrib.auth.models import Group
from django.db import transaction
from django.db.models import QuerySet
from django.forms import ModelForm, Select
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect
from django.urls import reverse
from django.utils.decorators import method_decorator
from django.utils.html import format_html
from django.utils.translation import gettext_lazy as _
from django.utils.translation import gettext_noop

from fleet.accounts import services
from fleet.accounts.models import Erasure, SignIn, User
from fleet.accounts.requests import person_of
from fleet.accounts.sign_in import second_factor
from fleet.audit.admin import ReadOnly
from fleet.audit.recorded_admin import RecordedAdmin
from fleet.base import zones
from fleet.base.web.time_takers import may_take_time

# Django's groups are not used: people have roles on single robots, and staff may do everything. The other
# tables belong to django-allauth: people change their own second factor and address, and the settings name
# the single sign-on.
admin.site.unregister([Group, EmailAddress, Authenticator, SocialAccount, SocialApp, SocialToken])


gettext_noop("staff status")  # Django’s own translations keep the word "staff"


class ListedLookups(RecordedAdmin):
    """Lists that a URL can filter only by the offered filters.

    Django allows filters by every column and by columns of related tables, also by the first characters of a
    value. With them, a person who may see a list could find out other people's session keys character by
    character.
    """

    def lookup_allowed(self, lookup: str, value: str, request: HttpRequest | None = None) -> bool:
        """Return whether a URL may filter by this column."""
        return lookup in {f"{name}__exact" for name in self.list_filter}


class PasswordForm(AdminPasswordChangeForm):  # type: ignore[type-arg]  # not subscriptable at run time
    """Django's form, whose help would be in English in every language."""

    usable_password_help_text = _(  # type: ignore[assignment]  # said in the reader's language
        "If disabled, the person can sign in by other ways only, and the present password is lost."
    )


@method_decorator(may_take_time, name="change_view")
@admin.register(User)
class PersonAdmin(ListedLookups, UserAdmin):  # type: ignore[type-arg]  # not subscriptable at run time
    """Accounts. They are never deleted, because the audit log refers to them: clear "active" instead."""

    list_display = ["username", "full_name", "email", "is_staff", "is_active", "last_login"]
    list_filter = ["is_staff", "is_active"]
    search_fields = ["username", "full_name", "email"]
    change_password_form = PasswordForm
    readonly_fields = ["project", "roles", "second_factor", "last_login", "date_joined"]
    actions = ["remove_second_factors"]
    filter_horizontal = []
    fieldsets = [
        (
            None,
            {
                "fields": [
                    "username",
                    "password",
                    "full_name",
                    "email",
                    "second_factor",
                    "time_zone",
                    "language",
                ]
            },
        ),
        (_("Rights"), {"fields": ["project", "is_active", "is_staff", "roles"]}),
        (_("Dates"), {"fields": ["last_login", "date_joined"]}),
    ]
    add_fieldsets = [
        (None, {"fields": ["username", "full_name", "email", "usable_password", "password1", "password2"]})
    ]

    @admin.display(description=_("Roles on robots"))
    def roles(self, user: User) -> str:
        """Return a link to the person's roles."""
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
        """Return the form field of a column. The time zone is a choice from the known zones."""
        if db_field.name == "language":
            options["widget"] = Select(choices=[("", _("the browser’s")), *settings.LANGUAGES])
        if db_field.name == "time_zone":
            options["widget"] = Select(
                choices=[("", _("the lab's")), (zones.UTC_ZONE, zones.UTC_ZONE), *zones.choices()]
            )
        return super().formfield_for_dbfield(db_field, request, **options)

    def get_object(self, request: HttpRequest, object_id: str, from_field: str | None = None) -> User | None:
        """Return the account to show or change. Its `changed_by` is the signed-in person."""
        person = super().get_object(request, object_id, from_field)
        if person is not None:
            person.changed_by = person_of(request)
        return person

    def save_model(self, request: HttpRequest, obj: User, form: ModelForm[User], change: bool) -> None:
        """Save a new or changed account. The record names the signed-in person as the actor."""
        obj.changed_by = person_of(request)
        was_to_be_erased = Erasure.objects.filter(person=obj).exists()
        super().save_model(request, obj, form, change)
        if was_to_be_erased and not Erasure.objects.filter(person=obj).exists():
            text = _(
                "The account is open again, and its person is not erased. Bookings that ended stay ended."
            )
            self.message_user(request, text, messages.SUCCESS)

    def user_change_password(self, request: HttpRequest, id: str, form_url: str = "") -> HttpResponse:
        """Change a person's password: their sign-ins and tokens end.

        A person who changes their own password stays signed in in this browser and keeps the tokens. A
        service account gets no password: it signs in by tokens only.
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
                else:  # a signal ended the person's sign-ins; Django gave this admin's session a new key
                    services.sign_in_begun(request, person_of(request))
                    notice = _(
                        "The person is signed out everywhere, and the tokens of their programs are ended."
                    )
                    self.message_user(request, notice, messages.INFO)
        return response

    def has_delete_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        """Return False: accounts are closed, not deleted."""
        return False


@admin.register(SignIn)
class SignInAdmin(ListedLookups, ReadOnly):
    """Current sign-ins and where they come from, read only. Closing an account ends its sign-ins."""

    list_display = ["user", "address", "device", "started_at", "seen_at"]
    fields = ["user", "address", "user_agent", "started_at", "seen_at"]
    search_fields = ["user__username", "user__full_name", "address"]
    list_select_related = ["user"]

    @admin.display(description=_("browser"))
    def device(self, sign_in: SignIn) -> str:
        """Return the browser and its system in plain words."""
        return sign_in.device
