"""Addresses of the REST API, under /api/."""

from django.urls import include, path

from teleop.api.v1 import unknown_address
from teleop.stop import views as stop_views

urlpatterns = [
    path("v1/", include("teleop.api.v1.urls")),
    # Programs that were written for version 0.1 stop robots at these addresses.
    path("robots/<slug:slug>/stop/", stop_views.rest_stop),
    path("robots/<slug:slug>/stop", stop_views.rest_stop),
    path("stop/", stop_views.rest_stop_all),
    path("stop", stop_views.rest_stop_all),
    path("<path:address>", unknown_address.UnknownAddress.as_view(schema=None)),
    path("", unknown_address.UnknownAddress.as_view(schema=None), {"address": ""}),
]
