"""Who had control of what, in the admin: to read, never to change."""

from __future__ import annotations

from typing import Any

from django.contrib import admin
from django.http import HttpRequest

from teleop.models import ControlSession


@admin.register(ControlSession)
class ControlSessionAdmin(admin.ModelAdmin):  # type: ignore[type-arg]  # not subscriptable at run time
    """Every stretch of control, newest first."""

    list_display = ["robot", "user", "started_at", "ended_at", "end_reason", "end_note"]
    list_filter = [
        ("started_at", admin.DateFieldListFilter),
        ("ended_at", admin.EmptyFieldListFilter),
        "end_reason",
        "robot",
    ]
    list_select_related = ["robot", "user"]
    search_fields = ["robot__name", "robot__slug", "user__username", "user__full_name"]
    date_hierarchy = "started_at"
    show_full_result_count = False  # counting all rows is the slow part of a long list
    actions = None

    def has_add_permission(self, request: HttpRequest) -> bool:
        """Control begins on a robot's page."""
        return False

    def has_change_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        """To read only."""
        return False

    def has_delete_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        """Records speak of them."""
        return False
