"""The console as an installed app: its manifest, its service worker, and the page that says it is offline."""

from __future__ import annotations

from django.contrib.auth.decorators import login_not_required
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import render
from django.templatetags.static import static
from django.urls import path, reverse
from django.utils.translation import gettext
from django.views.decorators.cache import cache_control
from django.views.decorators.http import require_safe

GROUND = "#f3f4f1"  # --bg of static/css/base/tokens.css, in light
COLOUR = "#0d6b66"
# All that the page for offline needs. Nothing else is ever kept.
OFFLINE_FILES = ("css/base/site.css", "js/page/offline.js", "img/icon.svg")


@login_not_required
@require_safe
@cache_control(no_cache=True)
def manifest(_request: HttpRequest) -> JsonResponse:
    """Say under which name and icon a device installs the console."""
    icons = [
        {"src": static("img/icon.svg"), "sizes": "any", "type": "image/svg+xml"},
        {"src": static("img/icon-192.png"), "sizes": "192x192", "type": "image/png"},
        {"src": static("img/icon-512.png"), "sizes": "512x512", "type": "image/png"},
        {
            "src": static("img/icon-maskable-512.png"),
            "sizes": "512x512",
            "type": "image/png",
            "purpose": "maskable",
        },
    ]
    return JsonResponse(
        {
            "id": "/",
            "name": "Fleet console",
            "short_name": "Fleet",
            "description": gettext("Drive and watch the lab’s robots."),
            "start_url": reverse("fleet"),
            "scope": "/",
            "display": "standalone",
            "background_color": GROUND,
            "theme_color": COLOUR,
            "icons": icons,
        },
        content_type="application/manifest+json",
    )


@login_not_required
@require_safe
@cache_control(no_cache=True)
def service_worker(request: HttpRequest) -> HttpResponse:
    """Send the worker. It stands at the root, since it looks after the folder that it comes from."""
    files = [reverse("offline"), *map(static, OFFLINE_FILES)]
    return render(request, "site/service_worker.js", {"files": files}, content_type="text/javascript")


@login_not_required
@require_safe
def offline(request: HttpRequest) -> HttpResponse:
    """Show the page that the worker shows without a connection."""
    return render(request, "site/offline.html")


urlpatterns = [
    path("manifest.webmanifest", manifest, name="manifest"),
    path("service-worker.js", service_worker, name="service-worker"),
    path("offline/", offline, name="offline"),
]
