"""People and their sign-ins."""

from __future__ import annotations

import uuid
from typing import Any

from django.contrib.sessions.models import Session
from django.db import models
from django.db.models.functions import Lower
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from fleet.accounts.changes import RecordedUser
from fleet.accounts.sign_in.devices import device_of


class User(RecordedUser):
    """A person. `is_staff` makes them staff on every robot; other roles are given robot by robot."""

    id = models.UUIDField(primary_key=True, default=uuid.uuid4, editable=False)
    first_name = None  # type: ignore[assignment]
    last_name = None  # type: ignore[assignment]
    full_name = models.CharField(_("name"), max_length=150, blank=True, help_text=_("As others see it."))
    time_zone = models.CharField(
        _("time zone"), max_length=64, blank=True, help_text=_("In which pages show times. Blank: the lab's.")
    )
    # The arrangement of the control page and the hints that were read: `PageChoicesForm`. Pages alone read it.
    page_choices = models.JSONField(default=dict, blank=True, editable=False)
    project = models.CharField(
        _("project"),
        max_length=80,
        blank=True,
        help_text=_("Of a service account, which belongs to no person and signs in by tokens only."),
    )

    class Meta(RecordedUser.Meta):
        ordering = ["username"]
        constraints = [
            models.UniqueConstraint(
                Lower("email"),
                condition=~models.Q(email=""),
                name="one_account_per_email",
                violation_error_message=_("Another account has this e-mail address."),
            )
        ]

    def __str__(self) -> str:
        return self.display_name

    def save(self, **options: Any) -> None:
        """Save, with the e-mail address in lower case, as it is compared."""
        self.email = self.email.lower()
        super().save(**options)

    @property
    def display_name(self) -> str:
        """The name to show: the full name, or the user name if there is none."""
        return self.full_name or self.username

    @property
    def supervised_robots(self) -> bool:
        """Return whether the person is supervisor of a robot by a role of their own; for the menu."""
        tables = (getattr(self, name, None) for name in ("robot_roles", "group_roles"))  # of apps above
        return any(roles is not None and roles.filter(role="supervisor").exists() for roles in tables)

    def get_full_name(self) -> str:
        """The full name; may be blank."""
        return self.full_name

    def get_short_name(self) -> str:
        """The name to show."""
        return self.display_name


class SignIn(models.Model):
    """One sign-in session as its owner sees it: the place of the sign-in and the time of the last use.

    It lives and dies with Django's session. `auth_hash` is the account's session hash at sign-in: it no
    longer matches once the password was changed, by whatever door.
    """

    # Pages name a sign-in by this, never by its session key: that one is as good as the cookie.
    id = models.UUIDField(primary_key=True, default=uuid.uuid4, editable=False)
    session = models.OneToOneField(Session, on_delete=models.CASCADE, related_name="sign_in", editable=False)
    user = models.ForeignKey(
        User, on_delete=models.CASCADE, related_name="sign_ins", verbose_name=_("person")
    )
    auth_hash = models.CharField(max_length=128, editable=False)
    started_at = models.DateTimeField(_("since"), default=timezone.now)
    seen_at = models.DateTimeField(_("last seen"), default=timezone.now)
    address = models.CharField(_("address"), max_length=64, blank=True)
    user_agent = models.CharField(_("browser"), max_length=300, blank=True)

    class Meta:
        ordering = ["-seen_at"]
        verbose_name = _("sign-in")
        verbose_name_plural = _("sign-ins")

    def __str__(self) -> str:
        return _("%(person)s from %(address)s") % {
            "person": self.user,
            "address": self.address or _("an unknown address"),
        }

    @property
    def device(self) -> str:
        """The browser and system in plain words."""
        return device_of(self.user_agent)


class SignInAttempt(models.Model):
    """A password that is being looked at. It counts as a failure until it was found right; see `throttle`."""

    at = models.DateTimeField(default=timezone.now)
    name_digest = models.CharField(max_length=32)
    address_digest = models.CharField(max_length=32)

    class Meta:
        indexes = [models.Index(fields=["address_digest", "at"])]

    def __str__(self) -> str:
        return self.at.isoformat()


# The app's other models.
from fleet.accounts.tokens.models import Token  # noqa: E402, F401 - after User, which it names
