"""Backups as a Django app, for its commands."""

from django.apps import AppConfig


class BackupConfig(AppConfig):
    """The app. It has no tables: the audit log knows the last backup."""

    name = "fleet.backup"
    label = "backup"
