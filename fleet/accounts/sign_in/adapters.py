"""Hooks of django-allauth: they apply the console's limits, write its records and send its e-mails."""

from __future__ import annotations

from typing import Any, cast
from urllib.parse import urlsplit

from allauth.account.adapter import DefaultAccountAdapter
from allauth.account.internal.stagekit import clear_login
from allauth.account.models import EmailAddress
from allauth.core.exceptions import ImmediateHttpResponse
from allauth.mfa.adapter import DefaultMFAAdapter
from allauth.mfa.models import Authenticator
from allauth.mfa.totp.internal.auth import generate_totp_secret
from allauth.socialaccount.adapter import DefaultSocialAccountAdapter
from allauth.socialaccount.models import SocialAccount, SocialLogin
from cryptography.fernet import InvalidToken
from django.contrib import messages
from django.core.exceptions import ValidationError
from django.db import IntegrityError, transaction
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _

from fleet.accounts import emails, services
from fleet.accounts.models import User
from fleet.accounts.names import AccountNames
from fleet.accounts.sign_in import second_factor, secrets, throttle
from fleet.audit.rates import require_sign_in_rate
from fleet.base.web.origin import public_origin, public_url


class AccountAdapter(DefaultAccountAdapter):
    """Passwords and e-mail addresses."""

    def is_open_for_signup(self, request: HttpRequest) -> bool:
        """Return False: only staff, invitations and single sign-on make accounts."""
        return False

    def clean_username(self, username: str, shallow: bool = False) -> str:
        """Refuse user names of newcomers as at every other door."""
        name: str = super().clean_username(username, shallow)
        if fault := AccountNames(User).fault_of_username(name):
            raise ValidationError(str(fault.text), code=fault.code)
        return name

    def get_client_ip(self, request: HttpRequest) -> str:
        """Return the address of the request; "unknown" for all when the server listens on a Unix socket."""
        return services.address_of(request) or "unknown"

    def get_http_user_agent(self, request: HttpRequest) -> str:
        return request.headers.get("User-Agent", "")

    def pre_login(self, request: HttpRequest, user: Any, **options: Any) -> HttpResponse | None:
        """Refuse a closed account, one that has signed in too often, and a service account: it has tokens only."""
        if user.project:
            clear_login(request)
            return cast(HttpResponse, self.respond_user_inactive(request, user))
        require_sign_in_rate(user, timezone.now())
        return cast("HttpResponse | None", super().pre_login(request, user, **options))

    def add_message(self, request: HttpRequest, level: int, *arguments: Any, **options: Any) -> None:
        """Show a message, except about signing in or out: the page itself shows that."""
        template = options.get("message_template") or (arguments[0] if arguments else "")
        if template not in ("account/messages/logged_in.txt", "account/messages/logged_out.txt"):
            super().add_message(request, level, *arguments, **options)

    def send_mail(self, template_prefix: str, email: str, context: dict[str, Any]) -> None:
        """Send an e-mail in the background: so the response time does not show whether the account exists."""
        site = {"domain": public_origin(self.request).partition("://")[2]}
        facts = {"email": email, "request": self.request, **context, "current_site": site}
        emails.send_later([self.render_mail(template_prefix, email, facts)])

    def get_reset_password_from_key_url(self, key: str) -> str:
        """Return the link of an e-mail, at the console's known address."""
        return self._at_home(super().get_reset_password_from_key_url(key))

    def get_email_confirmation_url(self, request: HttpRequest, emailconfirmation: Any) -> str:
        """Return the link of an e-mail, at the console's known address."""
        return self._at_home(super().get_email_confirmation_url(request, emailconfirmation))

    def _at_home(self, link: str) -> str:
        return public_url(self.request, urlsplit(link).path)

    def reauthenticate(self, user: Any, password: str) -> bool:
        """Return whether this is the person's password.

        A wrong password counts like one on the sign-in page.
        """
        return throttle.password_fits(user, password, address=services.address_of(self.request))

    def set_password(self, user: Any, password: str) -> None:
        """Set the password after a reset link from an e-mail was opened. Every sign-in of the person ends."""
        user.set_password(password)  # hashed before the transaction: inside it, other writers would wait, too
        user.changed_by = user
        with transaction.atomic():
            user.save()
            # The form has already ended the tokens, if the person chose that.
            services.password_reset(user=user, actor=user, why="password reset", tokens=False)

    def confirm_email(self, request: HttpRequest, email_address: EmailAddress) -> bool:
        """Give the verified address to the person.

        False, with a message, if another account has it by now.
        """
        email_address.user.changed_by = email_address.user
        try:
            with transaction.atomic():
                return bool(super().confirm_email(request, email_address))
        except IntegrityError:
            messages.error(request, _("Not done: another account has this e-mail address."))
            return False


class SecondFactorAdapter(DefaultMFAAdapter):
    """Authenticator apps, passkeys, recovery codes."""

    def encrypt(self, text: str) -> str:
        """Encrypt the secret of an authenticator app: a copy of the database is useless for making codes."""
        return secrets.encrypted(text)

    def decrypt(self, encrypted_text: str) -> str:
        """Return the secret.

        If FLEET_SECRET_KEY has changed, return a random secret, so that no code is right.
        """
        try:
            return secrets.decrypted(encrypted_text)
        except InvalidToken:
            return str(generate_totp_secret())

    def can_delete_authenticator(self, authenticator: Authenticator) -> bool:
        """Return False for the last second factor of a person who must have one."""
        return not second_factor.is_last_required(authenticator)


class SingleSignOnAdapter(DefaultSocialAccountAdapter):
    """People who sign in at the organisation's OpenID Connect provider."""

    def is_open_for_signup(self, request: HttpRequest, sociallogin: SocialLogin) -> bool:
        """Return True: the provider's people may have an account.

        It has no role until somebody gives it a role.
        """
        return True

    def pre_social_login(self, request: HttpRequest, sociallogin: SocialLogin) -> None:
        """Connect a newcomer with the account that has their e-mail address, if the provider verified it.

        Staff entered an account's address or the owner verified it, so the address identifies the person. A
        newcomer's unverified address is not stored: course lists would treat the newcomer as the owner of the
        address. An account is connected with only one person of the provider: an organisation may give an
        address to another person later.
        """
        for one in sociallogin.email_addresses:  # some providers send "verified" as text
            one.verified = str(one.verified).lower() == "true"
        if sociallogin.is_existing:
            return
        if sociallogin.state.get("process") == "connect":
            if _is_joined(request.user):
                text = _(
                    "This account is connected with another account of your organisation. Disconnect it first."
                )
                messages.error(request, text)
                raise ImmediateHttpResponse(redirect("socialaccount_connections"))
            return
        address = sociallogin.email_addresses[0] if sociallogin.email_addresses else None
        known = User.objects.filter(email=address.email.lower()).first() if address else None
        if known and (known.project or not known.is_active):
            raise ImmediateHttpResponse(redirect("account_inactive"))
        if known and address and address.verified and not _is_joined(known):
            sociallogin.connect(request, known)
        elif known:
            context = {"joined": _is_joined(known)}
            page = render(request, "accounts/single_sign_on_unverified.html", context, status=403)
            raise ImmediateHttpResponse(page)
        elif address and address.verified:
            # Other people may have typed this address. They cannot get its verification link.
            EmailAddress.objects.filter(email__iexact=address.email, verified=False).delete()
        elif address:
            sociallogin.email_addresses, sociallogin.user.email = [], ""

    def validate_disconnect(self, account: SocialAccount, accounts: list[SocialAccount]) -> None:
        """Refuse to disconnect a person without a password: they could not sign in any more."""
        if not account.user.has_usable_password():
            text = _(
                "Set a password first, by the link «Forgot your password?»: you could not sign in without it."
            )
            raise ValidationError(text, code="no_password")

    def populate_user(self, request: HttpRequest, sociallogin: SocialLogin, data: dict[str, Any]) -> Any:
        """Set the full name to the name that the provider sends."""
        user = cast(User, super().populate_user(request, sociallogin, data))
        parts = (data.get("first_name"), data.get("last_name"))
        name = data.get("name") or " ".join(filter(None, parts))
        user.full_name = " ".join(name.split())[:150]
        # The provider may take any: then the user name is shown
        if AccountNames(User).fault_of_name(user.full_name):
            user.full_name = ""
        return user

    def save_user(self, request: HttpRequest, sociallogin: SocialLogin, form: Any = None) -> Any:
        """Save a new account. The record names the person as the actor."""
        sociallogin.user.changed_by = sociallogin.user
        with transaction.atomic():
            return super().save_user(request, sociallogin, form)


def _is_joined(person: Any) -> bool:
    return bool(person.is_authenticated and SocialAccount.objects.filter(user=person).exists())
