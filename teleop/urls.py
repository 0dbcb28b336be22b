"""Addresses of the pages."""

from __future__ import annotations

from django.urls import path

from teleop import views

urlpatterns = [
    path("", views.fleet, name="fleet"),
    path("robots/<slug:slug>/", views.control, name="control"),
    path("robots/<slug:slug>/stop/", views.stop, name="stop"),
    path("stop-all/", views.stop_all, name="stop-all"),
]
