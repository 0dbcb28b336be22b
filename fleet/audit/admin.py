"""The audit log in the admin: to read, never to change."""

from __future__ import annotations

from typing import Any

from django.contrib import admin
from django.http import HttpRequest

from fleet.audit.models import Record


@admin.register(Record)
class RecordAdmin(admin.ModelAdmin):  # type: ignore[type-arg]  # not subscriptable at run time
    """Everything, newest first."""

    list_display = ["id", "at", "kind", "actor_name", "robot_name", "outcome", "parameters"]
    list_filter = [("at", admin.DateFieldListFilter), "kind", "robot_name", "actor__name"]
    list_select_related = ["actor"]
    search_fields = ["actor__name", "robot_name", "kind", "outcome"]
    ordering = ["-id"]
    show_full_result_count = False  # counting all rows is the slow part of a long list
    actions = None

    def has_add_permission(self, request: HttpRequest) -> bool:
        """Records are written by what happens."""
        return False

    def has_change_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        """Append-only."""
        return False

    def has_delete_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        """Append-only."""
        return False
