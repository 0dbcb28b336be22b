"""Pages that belong to no app: errors, admin sign-in, about, cookies, privacy, health."""

from __future__ import annotations

from typing import Any

from django.conf import settings
from django.contrib.auth.decorators import login_not_required
from django.contrib.auth.views import redirect_to_login
from django.core.exceptions import DisallowedHost, PermissionDenied, TooManyFieldsSent
from django.db import DatabaseError, connection
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.http.response import HttpResponseBase
from django.shortcuts import redirect, render
from django.urls import reverse
from django.utils.translation import get_language, override
from django.utils.translation import gettext_lazy as _
from django.utils.translation.trans_real import DjangoTranslation
from django.views.decorators.cache import cache_control, never_cache
from django.views.decorators.gzip import gzip_page
from django.views.decorators.http import require_safe
from django.views.i18n import JavaScriptCatalog

from fleet.accounts.middleware import TooManyFields
from fleet.accounts.requests import wants_json
from fleet.accounts.sign_in import known_device
from fleet.audit.errors import cause_of
from fleet.audit.kinds import Kept
from fleet.base import languages
from fleet.base.database import schema
from fleet.base.version import commit, version
from teleop.alerts.rules import open_alerts
from teleop.alerts.watch import knows, look_age_s

WHY_KEPT = {
    Kept.SPEECH: _("To find the person who made a robot say a sentence."),
    Kept.DRIVING: _("To see where and how fast a robot drove, and where its gate intervened."),
    Kept.OTHER: _("Reasons, names, addresses and browsers: to find misuse of accounts and rights."),
}


def bad_request(request: HttpRequest, exception: Exception) -> HttpResponse:
    """Handle 400. A form with too many fields is refused in words: it was too large, not wrong."""
    text = getattr(exception, "text", "")
    if isinstance(exception, TooManyFieldsSent):
        text = text or TooManyFields(settings.DATA_UPLOAD_MAX_NUMBER_FIELDS).text
        if wants_json(request):
            refusal = {"code": "too_many_fields", "text": text, "rule": "limits"}
            return JsonResponse(refusal, status=400)
    context = {"text": text, "foreign_name": isinstance(exception, DisallowedHost)}
    return render(request, "400.html", context, status=400)


def not_found(request: HttpRequest, exception: Exception) -> HttpResponse:
    """Handle 404, with advice for a robot, for an address of no page, and for anything else that is gone.

    Django's own handler reads the request's body, which fails again if the body is broken.
    """
    match = request.resolver_match
    robot = match.kwargs.get("slug") if match and match.route.startswith("robots/") else None
    return render(request, "404.html", {"robot": robot, "nowhere": match is None}, status=404)


@login_not_required
def admin_login(request: HttpRequest) -> HttpResponse:
    """Redirect from the admin's sign-in page: the console has only one sign-in page."""
    if not request.user.is_authenticated:
        return redirect_to_login(request.GET.get("next", reverse("admin:index")))
    if request.user.is_staff:
        return redirect("admin:index")
    raise PermissionDenied("The admin pages are for staff.")


class _ScriptTexts(JavaScriptCatalog):
    """Texts of scripts, and sentences about robots, in one catalogue."""

    def get_catalog(self) -> dict[str, Any]:
        """Return all translations by text."""
        language, folders = get_language() or settings.LANGUAGE_CODE, list(map(str, settings.LOCALE_PATHS))
        found: dict[str, Any] = {}
        for domain in ("sentences", self.domain):
            self.translation = DjangoTranslation(language, domain=domain, localedirs=folders)
            found |= super().get_catalog()
        return found


@login_not_required
@require_safe
@cache_control(private=True, max_age=300)
@gzip_page  # 160 kB in Spanish, 40 kB compressed
def script_texts(request: HttpRequest) -> HttpResponseBase:
    """Return the texts of scripts as a script: the content security policy forbids inline scripts.

    `language` is the page's: a person's choice may differ from that of the browser.
    """
    with override(languages.chosen(request.GET.get("language", "")) or get_language()):
        return _ScriptTexts.as_view(packages=["fleet.site"])(request)


@login_not_required
@require_safe
def cookies(request: HttpRequest) -> HttpResponse:
    """Show the cookies that the console sets, and why."""
    names = {"session": settings.SESSION_COOKIE_NAME, "csrf": settings.CSRF_COOKIE_NAME}
    context = {
        "names": names | {"device": known_device.cookie()},
        "session_hours": settings.SESSION_COOKIE_AGE // 3600,
        "device_days": known_device.KEPT.days,
    }
    return render(request, "site/cookies.html", context)


@require_safe
def about(request: HttpRequest) -> HttpResponse:
    """Show which release of the console this is."""
    return render(request, "site/about.html", {"version": version(), "commit": commit()})


@login_not_required
@require_safe
def privacy(request: HttpRequest) -> HttpResponse:
    """Show the personal data that the console keeps, why, and for how long."""
    records_days = settings.FLEET_AUDIT_KEEP_RECORDS_DAYS
    days = {kept: min(settings.FLEET_AUDIT_KEEP_DAYS[kept.value], records_days) for kept in Kept}
    classes = [{"what": kept.label, "why": WHY_KEPT[kept], "days": days[kept]} for kept in Kept]
    context = {
        "classes": classes,
        "records_days": records_days,
        "recording_days": settings.FLEET_RECORDINGS_KEEP_DAYS,
    }
    return render(request, "site/privacy.html", context)


@login_not_required
@never_cache
@require_safe
def healthz(request: HttpRequest) -> JsonResponse:
    """Report to monitoring whether the database answers and has the schema of this version.

    `needs` counts the open alerts by kind, as of `looked_s` seconds ago: with `?all=1` they are a trouble, too. A proxy
    that asks without it does not take a console out of service because a robot is gone.
    """
    needs: dict[str, int] = {}
    try:
        trouble = _trouble()
        needs = open_alerts() if trouble is None else {}
    except schema.SchemaRefused as refused:
        trouble = str(refused)
    except DatabaseError as error:
        _, cause = cause_of(error)
        trouble = f"{cause[0].upper()}{cause[1:]}."
    if trouble is None and "all" in request.GET:
        if not knows():
            trouble = "Whether something needs somebody is not known: this web process has not looked lately."
        elif needs:
            trouble = "Something needs somebody: see the page Status."
    age_s = look_age_s()
    looked_s = None if age_s is None else round(age_s)
    answer = {"ok": trouble is None, "text": trouble or "Ready.", "needs": needs, "looked_s": looked_s}
    return JsonResponse(answer, status=503 if trouble else 200)


@login_not_required
@require_safe
def livez(_request: HttpRequest) -> HttpResponse:
    """Report to monitoring that this process answers."""
    return HttpResponse("Alive.", content_type="text/plain")


def _trouble() -> str | None:
    with connection.cursor() as cursor:
        cursor.execute("SELECT 1")
    return schema.trouble(connection)
