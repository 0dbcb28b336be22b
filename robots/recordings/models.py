"""One row for each recording. The bytes are in a file, never in the database."""

from __future__ import annotations

from uuid import uuid4

from django.conf import settings
from django.db import models
from django.utils.translation import gettext_lazy as _

from robots.registry.models import Robot


class Kind(models.TextChoices):
    """The reason for a recording."""

    BLACK_BOX = "black_box", _("black box")
    BY_HAND = "by_hand", _("by hand")
    BOOKING = "booking", _("by booking")


class Place(models.TextChoices):
    """The store that has the file."""

    DIRECTORY = "directory", _("the computer of the bridge")
    S3 = "s3", _("the object store")
    GONE = "gone", _("deleted")


class Recording(models.Model):
    """A finished recording, as the recorder reported it (`TakenRecording`).

    `session` and `booking` are ids of rows that may be gone. A row stays when its file is deleted.
    `file` is empty when the bridge's computer has none any more, `object` when the object store has none.
    """

    id = models.UUIDField(primary_key=True, default=uuid4, editable=False)
    robot = models.ForeignKey(
        Robot, on_delete=models.PROTECT, related_name="recordings", verbose_name=_("robot")
    )
    # The owner: who asked for it, had control, or has the booking. Null: nobody, or the person was erased
    person = models.ForeignKey(
        settings.AUTH_USER_MODEL,
        null=True,
        blank=True,
        on_delete=models.SET_NULL,
        related_name="recordings",
        verbose_name=_("person"),
    )
    kind = models.CharField(_("kind"), max_length=16, choices=Kind)
    begins_at = models.DateTimeField(_("from"))
    ends_at = models.DateTimeField(_("to"))
    session = models.UUIDField(null=True, blank=True)
    booking = models.UUIDField(null=True, blank=True)
    course = models.CharField(_("course"), max_length=64, blank=True)  # slug
    reason = models.CharField(_("reason"), max_length=200, blank=True)
    topics = models.JSONField(_("topics"), default=list)  # of `RecordedTopic`
    events = models.JSONField(_("events"), default=list)  # of `KeptEvent`
    bytes = models.BigIntegerField(_("size"), default=0)
    dropped = models.PositiveIntegerField(default=0)  # messages that are missing in it
    left_out = models.PositiveIntegerField(default=0)  # topics that are not in it: there were too many
    cut = models.BooleanField(default=False)
    ended_by = models.CharField(
        max_length=300, blank=True
    )  # why it ended, in English, if nobody asked for it
    continues = models.UUIDField(null=True, blank=True)
    version = models.CharField(max_length=60, blank=True)  # of the console that recorded it
    place = models.CharField(_("stored in"), max_length=12, choices=Place, default=Place.DIRECTORY)
    directory = models.CharField(max_length=500, blank=True)  # on the computer of the bridge
    file = models.CharField(max_length=200)  # its name there
    object = models.CharField(
        max_length=400, blank=True
    )  # its key in the object store, also of one that is begun
    controls = models.JSONField(null=True)  # of `ShownControl`; null: not known
    thumbnail = models.BooleanField(default=False)  # beside it is a small picture
    # Retention leaves it alone. Null: nobody keeps it by hand
    kept_at = models.DateTimeField(_("kept"), null=True, blank=True)
    file_kept = models.BooleanField(default=False)  # the bridge's computer knows that it is kept
    # Times (ns, ends exclusive) that may stay in its file, in which a person is who was erased. Null: nobody is
    stays = models.JSONField(null=True, blank=True)
    deleted_at = models.DateTimeField(_("deleted"), null=True, blank=True)

    class Meta:
        ordering = ["-begins_at"]
        verbose_name = _("recording")
        verbose_name_plural = _("recordings")
        indexes = [
            models.Index(fields=["begins_at"], name="recordings_by_time"),
            models.Index(fields=["robot", "begins_at"], name="recordings_by_robot"),
            models.Index(fields=["person", "begins_at"], name="recordings_by_person"),
            models.Index(fields=["session"], name="recordings_by_session"),
            # Has all that `file_changes` reads: rows are large
            models.Index(fields=["id", "place", "kept_at", "file_kept", "file"], name="recordings_to_change"),
            models.Index(fields=["object", "place"], name="recordings_by_object"),
            models.Index(fields=["id"], condition=models.Q(stays__isnull=False), name="recordings_to_cut"),
        ]

    def __str__(self) -> str:
        return f"{self.robot} {self.begins_at:%Y-%m-%d %H:%M} UTC"
