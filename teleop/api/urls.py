"""Addresses of the REST API, under /api/."""

from __future__ import annotations

from django.urls import path, re_path

from teleop.api import views
from teleop.stop import views as stop_views

urlpatterns = [
    path("robots/", views.RobotList.as_view(), name="api-robots"),
    path("robots/<slug:slug>/", views.RobotDetail.as_view(), name="api-robot"),
    path("robots/<slug:slug>/phrases/", views.RobotPhrases.as_view(), name="api-phrases"),
    path("robots/<slug:slug>/speech/", views.RobotSpeech.as_view(), name="api-speech"),
    path("robots/<slug:slug>/stop/", stop_views.rest_stop, name="api-stop"),
    path("robots/<slug:slug>/stop", stop_views.rest_stop),
    path("stop/", stop_views.rest_stop_all, name="api-stop-all"),
    path("stop", stop_views.rest_stop_all),
    re_path(
        r"^(?:.*/)?$", views.NoSuchAddress.as_view()
    ),  # without its last slash, Django leads to the one with it
]
