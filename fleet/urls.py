"""Every address of the console."""

from django.contrib import admin
from django.urls import include, path

from fleet import views

admin.site.site_title = admin.site.site_header = "Fleet console"

urlpatterns = [
    path("accounts/", include("fleet.accounts.urls")),
    path("admin/login/", views.admin_login),
    path("admin/", admin.site.urls),
    path("healthz", views.healthz, name="healthz"),
    path("api/", include("teleop.api_urls")),
    path("", include("teleop.urls")),
    path("", include("robots.urls")),
]
