"""URLs of the registry's pages."""

from django.urls import path

from robots.check import views

urlpatterns = [path("robots/<slug:slug>/check/", views.robot_check, name="robot-check")]
