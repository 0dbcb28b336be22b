"""Addresses of the REST interface, under /api/."""

from __future__ import annotations

from django.urls import path, re_path

from teleop import api, stop_views

urlpatterns = [
    path("robots/", api.RobotList.as_view(), name="api-robots"),
    path("robots/<slug:slug>/", api.RobotDetail.as_view(), name="api-robot"),
    path("robots/<slug:slug>/phrases/", api.RobotPhrases.as_view(), name="api-phrases"),
    path("robots/<slug:slug>/speech/", api.RobotSpeech.as_view(), name="api-speech"),
    path("robots/<slug:slug>/stop/", stop_views.rest_stop, name="api-stop"),
    path("robots/<slug:slug>/stop", stop_views.rest_stop),
    path("stop/", stop_views.rest_stop_all, name="api-stop-all"),
    path("stop", stop_views.rest_stop_all),
    re_path(
        r"^(?:.*/)?$", api.NoSuchAddress.as_view()
    ),  # without its last slash, Django leads to the one with it
]
