"""Every address of the console."""

from importlib.util import find_spec

from django.contrib import admin
from django.urls import include, path
from django.views.generic import RedirectView

from fleet import views

urlpatterns = [
    path("accounts/", include("fleet.accounts.urls")),
    # One door to sign in by: throttled, recorded.
    path("admin/login/", RedirectView.as_view(pattern_name="sign-in", query_string=True)),
    path("admin/", admin.site.urls),
    path("healthz", views.healthz, name="healthz"),
    *(
        path(prefix, include(module))
        for prefix, module in (("", "teleop.urls"), ("", "robots.urls"), ("api/", "teleop.api_urls"))
        if find_spec(module)
    ),
]
