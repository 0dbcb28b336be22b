"""The tables of the audit log."""

from __future__ import annotations

import uuid
from typing import Any, NoReturn

from django.db import models
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from fleet.audit.errors import AppendOnly

_BESIDES = ["day", "of"]  # further columns of most indexes of records


class Actor(models.Model):
    """Somebody who did something: an account, by its identifier, or a person at the computer's command line.

    The name may change until the person is erased.
    """

    id = models.CharField(primary_key=True, max_length=64)  # the account's UUID, or "system:NAME"
    name = models.CharField(max_length=200)
    erased_at = models.DateTimeField("erased (UTC)", null=True, blank=True)

    def __str__(self) -> str:
        return self.name


class Chain(models.Model):
    """A robot with records; the nil UUID stands for no robot. Appending to a chain locks its row."""

    id = models.UUIDField(primary_key=True)
    name = models.CharField(max_length=200, blank=True)  # the robot's name in its latest record

    def __str__(self) -> str:
        return self.name or str(self.pk)


class Records(models.QuerySet["Record"]):
    """Records. They can only be read."""

    def update(self, **_fields: Any) -> NoReturn:
        raise AppendOnly

    def delete(self) -> NoReturn:
        raise AppendOnly


class Record(models.Model):
    """One action or its outcome. Never changed.

    `id` is the order number over all chains. `seq` is the place in the chain of the robot (or of no robot).
    `digest` also covers the record before. The robot is stored by its identifier and its name at that time,
    without a foreign key: a record is kept longer than the robot, or than the request whose outcome it is.
    Triggers in the database refuse the same changes as the methods here.
    """

    id = models.BigAutoField("order number", primary_key=True)
    at = models.DateTimeField("time (UTC)", default=timezone.now, editable=False)
    day = models.DateField("day (UTC)", editable=False)
    kind = models.CharField(max_length=64)
    actor = models.ForeignKey(  # None: the console itself
        Actor, null=True, blank=True, on_delete=models.PROTECT, related_name="records", db_index=False
    )
    real_actor = models.ForeignKey(  # the person who really did it, if that is another person
        Actor, null=True, blank=True, on_delete=models.PROTECT, related_name="+", db_index=False
    )
    robot_id = models.UUIDField("robot's id", null=True, blank=True)
    robot_name = models.CharField("robot", max_length=200, blank=True)
    session_id = models.UUIDField("control session", null=True, blank=True)
    fence = models.BigIntegerField("fence", null=True, blank=True)
    request_id = models.UUIDField("request", default=uuid.uuid4)
    of = models.ForeignKey(
        "self",
        verbose_name="outcome of",
        null=True,
        blank=True,
        on_delete=models.DO_NOTHING,
        related_name="outcomes",
        db_constraint=False,
        db_index=False,  # the index `audit_of` is used
    )
    outcome = models.CharField(max_length=200, blank=True)
    parameters = models.JSONField(default=dict, blank=True)
    # blank: the record never had content
    content_digest = models.CharField(max_length=64, blank=True, editable=False)
    seq = models.BigIntegerField("place in its chain", editable=False)
    digest = models.CharField(max_length=64, editable=False)

    objects = Records.as_manager()

    class Meta:
        verbose_name = _("record")
        verbose_name_plural = _("Everything")
        ordering = ["-id"]
        constraints = [
            models.UniqueConstraint(fields=["robot_id", "seq"], name="audit_chain_place"),
            models.UniqueConstraint(
                fields=["seq"], condition=models.Q(robot_id=None), name="audit_chain_place_no_robot"
            ),
        ]
        indexes = [
            models.Index(fields=["kind", "at"], name="audit_kind_at"),
            models.Index(fields=["kind", "id"], name="audit_kind"),
            models.Index(fields=["day", "id"], name="audit_day"),
            # The columns after `id` serve other filters of the lists, so that no filter has to read the
            # table.
            models.Index(fields=["robot_id", "id", *_BESIDES, "actor", "kind"], name="audit_robot"),
            models.Index(fields=["actor", "id", *_BESIDES, "robot_id", "kind"], name="audit_by_actor"),
            models.Index(
                fields=["robot_id", "kind", "id", *_BESIDES, "actor", "outcome"], name="audit_robot_kind"
            ),
            models.Index(
                fields=["actor", "kind", "id", *_BESIDES, "robot_id", "outcome"], name="audit_actor_kind"
            ),
            models.Index(
                fields=["kind", "outcome", "id", *_BESIDES, "robot_id", "actor"], name="audit_kind_outcome"
            ),
            models.Index(
                fields=["real_actor", "id", *_BESIDES, "actor", "robot_id", "kind", "outcome"],
                condition=models.Q(real_actor__isnull=False),
                name="audit_real_actor",
            ),
            models.Index(fields=["session_id", "id", "of", "actor", "real_actor"], name="audit_session"),
            # With kind and outcome: else SQLite would choose an index that begins with these.
            models.Index(
                fields=["of", "kind", "outcome"], condition=models.Q(of__isnull=False), name="audit_of"
            ),
            # For records without actor or robot: PostgreSQL does not read other indexes in order for NULL.
            models.Index(
                fields=["id", "kind", *_BESIDES, "robot_id", "outcome"],
                condition=models.Q(actor=None),
                name="audit_no_actor",
            ),
            models.Index(
                fields=["id", "kind", *_BESIDES, "actor", "outcome"],
                condition=models.Q(robot_id=None),
                name="audit_no_robot",
            ),
        ]

    def __str__(self) -> str:
        return f"#{self.pk} {self.kind}"

    def save(self, **options: Any) -> None:
        """Insert the record. Raises `AppendOnly` for a change."""
        if not self._state.adding:
            raise AppendOnly
        super().save(**options | {"force_insert": True})

    def delete(self, using: Any = None, keep_parents: bool = False) -> NoReturn:
        raise AppendOnly

    @property
    def actor_name(self) -> str:
        """Return the actor's current name; blank for the console itself."""
        return self.actor.name if self.actor else ""

    @property
    def details(self) -> dict[str, Any]:
        """Return the parameters with the content that is still kept; `text`: words of a person or robot."""
        content = self.content_kept
        if content is None:
            return dict(self.parameters)
        said = {"text": content.text} if content.text else {}
        return {**self.parameters, **content.data, **said}

    @property
    def content_kept(self) -> Content | None:
        """Return the content of this record that may expire, if it is still kept."""
        try:
            return self.content
        except Content.DoesNotExist:
            return None


class Content(models.Model):
    """Content that may expire or be erased: texts, names, addresses. Inserted and deleted, never changed.

    The record keeps a digest of it, so the chain can be verified with the content or without it.
    """

    record = models.OneToOneField(Record, primary_key=True, on_delete=models.PROTECT, related_name="content")
    text = models.TextField(blank=True)  # words of a person or robot; searched
    data = models.JSONField(default=dict, blank=True)
    salt = models.CharField(max_length=32)  # hex

    def __str__(self) -> str:
        return f"content of #{self.pk}"

    def save(self, **options: Any) -> None:
        """Insert the content. Raises `AppendOnly` for a change."""
        if not self._state.adding:
            raise AppendOnly
        super().save(**options | {"force_insert": True})


class ContentSearch(models.Model):
    """The search index of the texts (trigrams): a virtual table of SQLite. See `integrity.triggers`."""

    rowid = models.BigIntegerField(primary_key=True)  # the record's number
    text = models.TextField()

    class Meta:
        managed = False
        db_table = "audit_content_search"

    def __str__(self) -> str:
        return f"text of #{self.pk}"


# --- lists of the admin ---------------------------------------------------------------------------


class SpeechRecord(Record):
    """Texts that robots spoke."""

    class Meta:
        proxy = True
        verbose_name = _("text")
        verbose_name_plural = _("Speech history")


class MotionRecord(Record):
    """Drives and motions."""

    class Meta:
        proxy = True
        verbose_name = _("drive or motion")
        verbose_name_plural = _("Motion history")


class RefusalRecord(Record):
    """Refusals and gate interventions."""

    class Meta:
        proxy = True
        verbose_name = _("refusal or gate intervention")
        verbose_name_plural = _("Refusals and gate interventions")
