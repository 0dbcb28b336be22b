"""URLs under /accounts/.

The pages of django-allauth that this console uses are listed singly, with allauth's names.
"""

from allauth.account import views as allauth
from allauth.socialaccount import views as single_sign_on
from django.contrib.auth.decorators import login_not_required
from django.contrib.auth.views import LogoutView
from django.urls import include, path, re_path
from django.views.generic import RedirectView

from fleet.accounts.pages import views
from fleet.accounts.sign_in.forms import ForgottenPasswordForm
from fleet.accounts.sign_in.views import (
    NewPasswordView,
    PasswordView,
    SignInView,
    single_sign_on_begin,
    single_sign_on_end,
)

_sign_in = SignInView.as_view()
_sign_out = LogoutView.as_view()
_new_password = NewPasswordView.as_view()
_forgotten = allauth.PasswordResetView.as_view(form_class=ForgottenPasswordForm)

urlpatterns = [
    path("", views.account, name="your-account"),
    path("sign-in/", _sign_in, name="sign-in"),
    path("sign-in/", _sign_in, name="account_login"),
    path("sign-out/", _sign_out, name="sign-out"),
    path("sign-out/", _sign_out, name="account_logout"),
    path("settings/", views.own_settings, name="your-settings"),
    path("settings/page/", views.page_choices, name="page-choices"),
    path("password/", PasswordView.as_view(), name="password"),
    path("sessions/", views.sessions, name="sessions"),
    path("sessions/<uuid:sign_in_id>/end/", views.session_end, name="session-end"),
    path("sessions/end-others/", views.sessions_end_others, name="sessions-end-others"),
    path("closed/", allauth.account_inactive, name="account_inactive"),
    path("again/", allauth.reauthenticate, name="account_reauthenticate"),
    path("email/", allauth.email, name="account_email"),
    re_path(r"^email/(?P<key>[-:\w]+)/$", allauth.confirm_email, name="account_confirm_email"),
    path("password/forgotten/", _forgotten, name="account_reset_password"),
    path("password/forgotten/sent/", allauth.password_reset_done, name="account_reset_password_done"),
    re_path(
        r"^password/new/(?P<uidb36>[0-9A-Za-z]+)-(?P<key>.+)/$",
        _new_password,
        name="account_reset_password_from_key",
    ),
    path(
        "password/new/done/",
        login_not_required(RedirectView.as_view(pattern_name="sign-in")),
        name="account_reset_password_from_key_done",
    ),
    path("second-factor/", include("allauth.mfa.urls")),
    path("single-sign-on/", single_sign_on.connections, name="socialaccount_connections"),
    path("single-sign-on/cancelled/", single_sign_on.login_cancelled, name="socialaccount_login_cancelled"),
    path("single-sign-on/failed/", single_sign_on.login_error, name="socialaccount_login_error"),
    path("oidc/<slug:provider_id>/login/", single_sign_on_begin, name="openid_connect_login"),
    path("oidc/<slug:provider_id>/login/callback/", single_sign_on_end, name="openid_connect_callback"),
]
