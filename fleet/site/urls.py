"""All URLs of the console."""

from django.contrib import admin
from django.urls import include, path
from django.views.generic import RedirectView

from fleet.site.pages import app, bridge_hosts, mail, people, setup, views
from teleop.api.metrics import MetricsView

admin.site.site_title = admin.site.site_header = "Fleet console"

handler400 = "fleet.site.pages.views.bad_request"
handler404 = "fleet.site.pages.views.not_found"
handler500 = "fleet.site.pages.unavailable.error_page"

urlpatterns = [
    path("api/", include("teleop.api.urls")),  # first, because programs send the most requests
    path("setup/", include(setup)),
    path("accounts/", include("fleet.accounts.pages.urls")),
    path("admin/login/", views.admin_login),
    path("admin/password_change/", RedirectView.as_view(pattern_name="password")),
    path("admin/", admin.site.urls),
    path("healthz", views.healthz, name="healthz"),
    path("readyz", views.healthz),
    path("livez", views.livez),
    path("about/", views.about, name="about"),
    path("metrics", MetricsView.as_view()),
    path("cookies/", views.cookies, name="cookies"),
    path("bridge-hosts/join/", bridge_hosts.join, name="bridge-host-join"),
    path("mail/", mail.mail, name="mail"),
    path("people/export/", people.people_export, name="people-export"),
    path("people/erase/", people.people_erase, name="people-erase"),
    path("privacy/", views.privacy, name="privacy"),
    path("", include(app)),
    path("help/", include("fleet.help.urls")),
    path("texts.js", views.script_texts, name="script-texts"),
    path("", include("fleet.bookings.pages.urls")),
    path("", include("teleop.urls")),
    path("", include("robots.check.urls")),
    path("", include("robots.access.urls")),
]
