"""System checks: is what the pages need there? `manage.py check` tells."""

from __future__ import annotations

from typing import Any

from django.conf import settings
from django.core.checks import CheckMessage, Tags, Warning, register


@register(Tags.staticfiles)
def npm_packages_installed(**_: Any) -> list[CheckMessage]:
    """The browser libraries come from npm."""
    return [
        Warning(
            f"The browser library for /static/{prefix}/ is not installed: there is no {folder}.",
            hint="Run: npm ci --omit=dev",
            id="fleet.W001",
        )
        for prefix, folder in settings.NPM_DISTRIBUTIONS
        if not folder.is_dir()
    ]


@register(Tags.staticfiles, deploy=True)
def static_files_collected(**_: Any) -> list[CheckMessage]:
    """Production serves collected files only."""
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
    """Without it passwords can be read on their way."""
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
