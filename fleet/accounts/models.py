"""People and their sign-ins."""

from __future__ import annotations

import uuid
from typing import Any

from django.contrib.sessions.models import Session
from django.db import models, transaction
from django.db.models.functions import Lower
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from fleet.accounts.changes import RecordedUser
from fleet.accounts.names import require_names
from fleet.accounts.sign_in.devices import device_of
from fleet.base.names import NameField

ERASED = "erased-"  # begins the user name of an account whose person was erased


class User(RecordedUser):
    """A person.

    `is_staff` makes them staff on every robot; every other role is for one robot or group of robots.
    """

    id = models.UUIDField(primary_key=True, default=uuid.uuid4, editable=False)
    first_name = None  # type: ignore[assignment]
    last_name = None  # type: ignore[assignment]
    full_name = NameField(_("name"), max_length=150, blank=True, help_text=_("As others see it."))
    time_zone = models.CharField(
        _("time zone"), max_length=64, blank=True, help_text=_("In which pages show times. Blank: the lab's.")
    )
    language = models.CharField(
        _("language"), max_length=10, blank=True, help_text=_("Of pages and e-mails. Blank: the browser’s.")
    )
    # The person's choices on the control page; see `PageChoicesForm`. Only pages read this.
    page_choices = models.JSONField(default=dict, blank=True, editable=False)
    # None: the mail server took the last e-mail.
    email_refused_at = models.DateTimeField(null=True, blank=True, editable=False)
    project = NameField(
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

    def clean(self) -> None:
        """Refuse names that people would mistake for those of other accounts."""
        super().clean()
        before = None if self._state.adding else User.objects.filter(pk=self.pk).first()
        require_names(self, before)

    def save(self, **options: Any) -> None:
        """Save the account. The e-mail address is stored in lower case, because addresses are compared so.

        An account that is opened again is not erased.
        """
        self.email = self.email.lower()
        fields = options.get("update_fields")
        with transaction.atomic():
            super().save(**options)
            if self.is_active and (fields is None or "is_active" in fields):
                Erasure.objects.filter(person=self, claimed_at=None).delete()

    @property
    def display_name(self) -> str:
        """Return the name to show: the full name, or the user name if there is none."""
        return self.full_name or self.username

    @property
    def supervised_robots(self) -> bool:
        """Return whether the person has a supervisor role on a robot or group; for the menu."""
        # The two tables belong to apps above.
        tables = (getattr(self, name, None) for name in ("robot_roles", "group_roles"))
        return any(roles is not None and roles.filter(role="supervisor").exists() for roles in tables)

    def get_full_name(self) -> str:
        return self.full_name

    def get_short_name(self) -> str:
        return self.display_name


class SignIn(models.Model):
    """One sign-in session as its owner sees it: address and browser, and the time of the last use.

    It is deleted with Django's session. `auth_hash` is the account's session hash at sign-in: it does not
    match any more after a change of the password, wherever the password was changed.
    """

    # Pages refer to a sign-in by this id, never by its session key, which is the secret in the cookie.
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
        """Return the browser and its system in plain words."""
        return device_of(self.user_agent)


class SignInAttempt(models.Model):
    """A password that is being checked. It counts as a failure until the check succeeds; see `throttle`."""

    at = models.DateTimeField(default=timezone.now)
    name_digest = models.CharField(max_length=32)
    address_digest = models.CharField(max_length=32)

    class Meta:
        indexes = [models.Index(fields=["address_digest", "at"])]

    def __str__(self) -> str:
        return self.at.isoformat()


class Erasure(models.Model):
    """A person who will be erased for good, unless the closed account is opened again before; see `erasing`."""

    person = models.OneToOneField(User, on_delete=models.CASCADE, related_name="erasure")
    asked_by = models.ForeignKey(User, on_delete=models.CASCADE, related_name="+")
    asked_at = models.DateTimeField()
    claimed_at = models.DateTimeField(null=True, blank=True)  # a housekeeping process erases the person now

    def __str__(self) -> str:
        return str(self.person_id)


# The app's other models.
from fleet.accounts.tokens.models import Ticket, Token  # noqa: E402, F401 - after User, which they name
