"""Every address of the console."""

from django.contrib import admin
from django.urls import include, path
from django.views.generic import RedirectView

from fleet import views

admin.site.site_title = admin.site.site_header = "Fleet console"

handler500 = "fleet.unavailable.error_page"

urlpatterns = [
    path("accounts/", include("fleet.accounts.urls")),
    path("admin/login/", views.admin_login),
    path("admin/password_change/", RedirectView.as_view(pattern_name="password")),
    path("admin/", admin.site.urls),
    path("healthz", views.healthz, name="healthz"),
    path("api/", include("teleop.api_urls")),
    path("", include("teleop.urls")),
    path("", include("robots.urls")),
]
