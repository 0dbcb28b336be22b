"""System checks of `manage.py check`: whether everything exists that the pages need."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import Any

from django.conf import settings
from django.core.checks import CheckMessage, Error, Tags, Warning, register
from django.db import connections
from django.db.backends.base.base import BaseDatabaseWrapper
from django.db.migrations.loader import MigrationLoader

from fleet.accounts.emails import fault_of_sender
from robots.link import authority


@register(Tags.staticfiles)
def npm_packages_installed(**_: Any) -> list[CheckMessage]:
    """Check that the browser libraries, which come from npm, are installed."""
    return [
        Warning(
            f"The browser library for /static/{prefix}/ is not installed: there is no {folder}.",
            hint="Run: script/setup web",
            id="fleet.W001",
        )
        for prefix, folder in settings.NPM_DISTRIBUTIONS
        if not folder.is_dir()
    ]


@register(Tags.staticfiles, deploy=True)
def static_files_collected(**_: Any) -> list[CheckMessage]:
    """Check that static files are collected: production serves only collected files."""
    if settings.DEBUG or (settings.STATIC_ROOT / "staticfiles.json").is_file():
        return []
    return [
        Warning(
            f"Static files are not collected in {settings.STATIC_ROOT}: no page can be shown.",
            hint="Run: manage.py collectstatic --noinput",
            id="fleet.W002",
        )
    ]


@register(Tags.security, deploy=True)
def tls_is_on(**_: Any) -> list[CheckMessage]:
    """Check that TLS is on: without it, others on the network can read passwords."""
    if settings.DEBUG or settings.FLEET_TLS:
        return []
    return [
        Warning(
            "FLEET_TLS is off: passwords and cookies travel readable for everybody on the network, and browsers on "
            "other computers withhold gamepads and wake lock.",
            hint="Serve TLS (docs/deployment.md), and set FLEET_TLS=1.",
            id="fleet.W003",
        )
    ]


@register()
def e_mails_have_a_sender(**_: Any) -> list[CheckMessage]:
    """Check that e-mails can be sent: with a malformed sender, all wait and are lost after a day."""
    if not (fault := fault_of_sender(settings.DEFAULT_FROM_EMAIL)):
        return []
    return [Warning(fault, hint="Correct FLEET_EMAIL_FROM: until then no e-mail is sent.", id="fleet.W004")]


@register()
def other_bridges_are_trusted(**_: Any) -> list[CheckMessage]:
    """Check that a bridge host knows who signed the certificates of bridges on other computers."""
    if settings.FLEET_LINK_CA or not settings.FLEET_LINK_CERT or not authority.of_other_console():
        return []
    return [
        Warning(
            "FLEET_LINK_CA is not set: `manage.py stop --all` here cannot stop robots of other computers.",
            hint="Join again (docs/upgrade.md), or name the authority that signed the bridges' certificates.",
            id="fleet.W005",
        )
    ]


@register(Tags.database)
def squashed_migrations_are_whole(databases: Iterable[str] | None = None, **_: Any) -> list[CheckMessage]:
    """Refuse a database with only a part of the migrations that a squashed migration replaces.

    Django would silently skip the other ones.
    """
    loaders = [MigrationLoader(connections[alias]) for alias in databases or ()]
    return [
        Error(
            f"The database has {len(applied)} of the {len(migration.replaces)} migrations that {migration} replaces.",
            hint="Run manage.py migrate at commit 358ebd0 first (docs/upgrade.md).",
            id="fleet.E001",
        )
        for loader in loaders
        for migration in loader.replacements.values()
        if 0
        < len(applied := loader.applied_migrations.keys() & {*migration.replaces})
        < len(migration.replaces)
    ]


@register(Tags.database)
def data_fit_the_migrations(databases: Iterable[str] | None = None, **_: Any) -> list[CheckMessage]:
    """Refuse to migrate while data would stop a migration, which would leave the database half migrated.

    A migration that data may stop has a function `obstacles(connection)` beside its class, which names all of them.
    """
    return [
        Error(f"Before the migration {app}.{name}, nothing is changed. {found}", id="fleet.E002")
        for alias in databases or ()
        for loader in [MigrationLoader(connections[alias])]
        for (app, name), migration in sorted(loader.disk_migrations.items())
        if (app, name) not in loader.applied_migrations
        for found in getattr(sys.modules[type(migration).__module__], "obstacles", _none)(connections[alias])
    ]


def _none(_connection: BaseDatabaseWrapper) -> list[str]:
    return []
