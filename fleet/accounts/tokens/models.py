"""Tokens of programs."""

from __future__ import annotations

import uuid

from django.conf import settings
from django.db import models
from django.utils.translation import gettext_lazy as _

from fleet.base.names import NameField


class Scope(models.TextChoices):
    """A part of the API that a token may use."""

    READ = "read", _("read robots, bookings and what is on record")
    DRIVE = "drive", _("take control and drive")
    SPEAK = "speak", _("let robots speak")
    MOTIONS = "motions", _("play motions")
    TOPICS = "topics", _("read and publish topics, call services, set parameters")
    BOOK = "book", _("book robots")
    MANAGE = "manage", _("manage courses, robots and policies")


class Token(models.Model):
    """A token of a person or a service account.

    The token is 256 random bits; only its SHA-256 digest is stored.

    A program may use it for its scopes, on its robots, and never for more than its person may do.
    """

    id = models.UUIDField(primary_key=True, default=uuid.uuid4, editable=False)
    digest = models.CharField(max_length=64, unique=True, editable=False)
    user = models.ForeignKey(
        settings.AUTH_USER_MODEL,
        on_delete=models.CASCADE,
        related_name="tokens",
        verbose_name=_("person"),
    )
    name = NameField(_("name"), max_length=40)
    scopes = models.JSONField(_("scopes"), default=list)  # of `Scope`
    # Ids of robots (no foreign keys: robots belong to an app above). Empty: all that the person may see.
    robots = models.JSONField(_("robots"), default=list, blank=True)
    made_by = models.ForeignKey(
        settings.AUTH_USER_MODEL, on_delete=models.CASCADE, related_name="made_tokens", editable=False
    )
    # The token with which a program made this one: when a token ends, the tokens that it made end, too.
    made_with = models.ForeignKey(
        "self", null=True, blank=True, on_delete=models.CASCADE, related_name="children", editable=False
    )
    made_at = models.DateTimeField(_("made"))
    expires_at = models.DateTimeField(_("expires"))
    used_at = models.DateTimeField(_("last used"), null=True, blank=True)
    used_from = models.CharField(_("last used from"), max_length=64, blank=True)

    class Meta:
        ordering = ["name", "id"]
        verbose_name = _("token")
        verbose_name_plural = _("tokens")

    def __str__(self) -> str:
        return self.name

    def opens(self, scope: Scope) -> bool:
        return scope in self.scopes

    def serves(self, robot_id: uuid.UUID) -> bool:
        """Return whether it may be used for this robot."""
        return not self.robots or str(robot_id) in self.robots


class Ticket(models.Model):
    """A sign-in at a door of programs, for one use within a minute. Only its SHA-256 digest is stored."""

    digest = models.CharField(max_length=64, primary_key=True, editable=False)
    user = models.ForeignKey(settings.AUTH_USER_MODEL, on_delete=models.CASCADE, related_name="tickets")
    token = models.ForeignKey(Token, null=True, on_delete=models.CASCADE, related_name="tickets")
    session_key = models.CharField(max_length=40, blank=True)  # of a person's sign-in, if no token asked
    robot = models.CharField(max_length=50)  # slug: robots belong to an app above
    door = models.CharField(max_length=20)
    expires_at = models.DateTimeField()

    def __str__(self) -> str:
        return f"{self.door} {self.robot}"

    @property
    def sign_in(self) -> str:
        """The key of the session or token that asked for it."""
        return f"token:{self.token_id}" if self.token_id else self.session_key
