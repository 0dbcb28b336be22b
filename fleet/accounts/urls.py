"""Addresses under /accounts/."""

from django.contrib.auth.views import LogoutView
from django.urls import path

from fleet.accounts import views

urlpatterns = [
    path("sign-in/", views.SignInView.as_view(), name="sign-in"),
    path("sign-out/", LogoutView.as_view(), name="sign-out"),
    path("settings/", views.own_settings, name="your-settings"),
    path("password/", views.PasswordView.as_view(), name="password"),
    path("sessions/", views.sessions, name="sessions"),
    path("sessions/<uuid:sign_in_id>/end/", views.session_end, name="session-end"),
    path("sessions/end-others/", views.sessions_end_others, name="sessions-end-others"),
]
