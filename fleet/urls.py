"""Every address of the console."""

from importlib.util import find_spec

from django.contrib import admin
from django.urls import include, path

from fleet import views

admin.site.site_title = admin.site.site_header = "Fleet console"

urlpatterns = [
    path("accounts/", include("fleet.accounts.urls")),
    path("admin/login/", views.admin_login),
    path("admin/", admin.site.urls),
    path("healthz", views.healthz, name="healthz"),
    *(
        path(prefix, include(module))
        for prefix, module in (("", "teleop.urls"), ("", "robots.urls"), ("api/", "teleop.api_urls"))
        if find_spec(module)
    ),
]
