"""The audit table."""

from __future__ import annotations

import uuid
from typing import Any, NoReturn

from django.db import models
from django.utils import timezone

from fleet.audit.errors import AppendOnly


class Records(models.QuerySet["Record"]):
    """Records to read."""

    def update(self, **_fields: Any) -> NoReturn:
        """Refused: the table is append-only."""
        raise AppendOnly

    def delete(self) -> NoReturn:
        """Refused: the table is append-only."""
        raise AppendOnly


class Record(models.Model):
    """One thing that somebody did, or what came of it. Never changed, never deleted.

    `id` is the order number. People and robots are kept by identifier and by the name they had then, without
    foreign keys: a record outlives both. Triggers in the database refuse what the methods here refuse.
    """

    id = models.BigAutoField("order number", primary_key=True)
    at = models.DateTimeField("time (UTC)", default=timezone.now, editable=False)
    kind = models.CharField(max_length=64)
    actor_id = models.CharField("actor's id", max_length=64, blank=True)  # "": the console itself
    actor_name = models.CharField("actor", max_length=200, blank=True)
    robot_id = models.UUIDField("robot's id", null=True, blank=True)
    robot_name = models.CharField("robot", max_length=200, blank=True)
    session_id = models.UUIDField("control session", null=True, blank=True)
    fence = models.BigIntegerField("fencing number", null=True, blank=True)
    request_id = models.UUIDField("request", default=uuid.uuid4)
    of = models.ForeignKey(
        "self",
        verbose_name="outcome of",
        null=True,
        blank=True,
        on_delete=models.PROTECT,
        related_name="outcomes",
    )
    outcome = models.CharField(max_length=200, blank=True)
    parameters = models.JSONField(default=dict, blank=True)

    objects = Records.as_manager()

    class Meta:
        ordering = ["-id"]
        indexes = [
            models.Index(fields=["kind", "at"], name="audit_kind_at"),
            models.Index(fields=["robot_id", "id"], name="audit_robot"),
            models.Index(fields=["robot_id", "kind", "id"], name="audit_robot_kind"),
            models.Index(fields=["actor_id", "id"], name="audit_actor"),
            models.Index(fields=["session_id", "id"], name="audit_session"),
        ]

    def __str__(self) -> str:
        return f"#{self.pk} {self.kind}"

    def save(self, **options: Any) -> None:
        """Insert; anything else is refused."""
        if not self._state.adding:
            raise AppendOnly
        super().save(**options | {"force_insert": True})

    def delete(self, using: Any = None, keep_parents: bool = False) -> NoReturn:
        """Refused: the table is append-only."""
        raise AppendOnly
