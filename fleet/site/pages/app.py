"""The console as an installed web app: its manifest, its service worker, and the page for offline use."""

from __future__ import annotations

from django.contrib.auth.decorators import login_not_required
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import render
from django.templatetags.static import static
from django.urls import path, reverse
from django.utils.translation import gettext
from django.views.decorators.cache import cache_control
from django.views.decorators.http import require_safe

GROUND = "#f3f4f1"  # --bg of static/css/base/tokens.css in the light theme
COLOUR = "#0d6b66"
# All files that the offline page needs. The service worker stores no other files.
OFFLINE_FILES = ("css/base/site.css", "js/page/offline.js", "img/icon.svg")


@login_not_required
@require_safe
@cache_control(no_cache=True)
def manifest(_request: HttpRequest) -> JsonResponse:
    """Return the manifest: the name, icons and colours with which a device installs the console."""
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
    """Send the service worker. Its URL is at the root, because a worker serves only the folder of its URL."""
    files = [reverse("offline"), *map(static, OFFLINE_FILES)]
    context = {"files": files, "icon": static("img/icon-192.png")}
    return render(request, "site/service_worker.js", context, content_type="text/javascript")


@login_not_required
@require_safe
def offline(request: HttpRequest) -> HttpResponse:
    """Show the page that the service worker shows when there is no connection."""
    return render(request, "site/offline.html")


urlpatterns = [
    path("manifest.webmanifest", manifest, name="manifest"),
    path("service-worker.js", service_worker, name="service-worker"),
    path("offline/", offline, name="offline"),
]
