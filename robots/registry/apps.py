"""The registry as a Django app."""

from __future__ import annotations

from typing import Any

from django.apps import AppConfig
from django.apps import apps as installed_apps
from django.db import DEFAULT_DB_ALIAS
from django.db.models.signals import post_migrate, pre_delete
from django.utils.translation import gettext_lazy as _


class RobotsConfig(AppConfig):
    """Loads the shipped profiles after each migration."""

    name = "robots.registry"
    label = "robots"
    verbose_name = _("Robots")

    def ready(self) -> None:
        """Register the steps after a migration and before the deletion of a robot."""
        from robots.registry.models import Robot

        post_migrate.connect(_load_shipped_profiles, sender=self)
        pre_delete.connect(_robot_deleted, sender=Robot)


def _robot_deleted(*, instance: Any, **_others: Any) -> None:
    """Record a robot's deletion in the same transaction. The admin never deletes a robot, but a program may."""
    from robots.registry.services import robot_deleted

    robot_deleted(instance)


def _load_shipped_profiles(*, using: str, apps: Any = installed_apps, **_others: Any) -> None:
    """Load the shipped profiles, but only if all migrations have run: an older table does not fit today's model.

    `manage.py flush` sends the signal without `apps`.
    """
    from robots.registry.models import RobotProfile
    from robots.registry.services import profiles_load_shipped

    try:
        migrated = apps.get_model("robots", "RobotProfile")
        apps.get_model("audit", "Record")
    except LookupError:
        return
    whole = {field.name for field in migrated._meta.fields} == {
        field.name for field in RobotProfile._meta.fields
    }
    if whole and using == DEFAULT_DB_ALIAS:
        profiles_load_shipped()
