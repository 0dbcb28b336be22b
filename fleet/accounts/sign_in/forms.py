"""Forms of sign-in and of the e-mail address."""

from __future__ import annotations

from typing import Any

from allauth.account.forms import AddEmailForm, ResetPasswordForm, ResetPasswordKeyForm
from allauth.account.internal.flows.email_verification import send_verification_email_to_address
from allauth.account.models import EmailAddress
from django import forms
from django.contrib.auth.forms import AuthenticationForm, PasswordChangeForm
from django.core.exceptions import ValidationError
from django.db import transaction
from django.http import HttpRequest
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy

from fleet.accounts import services
from fleet.accounts.models import User
from fleet.accounts.selectors import username_of
from fleet.accounts.sign_in import throttle
from fleet.accounts.tokens.services import tokens_end, tokens_of

THROTTLED = "throttled"
BUSY = "busy"  # other attempts with this name are being checked
RETRY_AFTER_S = 5


class SignInForm(AuthenticationForm):
    """User name or e-mail address, and password. The password is not checked while the name must wait."""

    wait_s = 0.0

    def clean(self) -> dict[str, Any]:
        """Refuse with code "throttled" or "busy", or check the password."""
        typed = self.cleaned_data.get("username")
        if not (typed and self.cleaned_data.get("password")):
            return super().clean()
        username = self.cleaned_data["username"] = username_of(typed)
        address = services.address_of(self.request) if self.request else ""
        try:
            with throttle.attempt(username=username, address=address):
                return super().clean()
        except throttle.TooMany as error:
            if error.wait_s:
                self.wait_s = error.wait_s
                raise self._throttled() from error
            raise self._busy() from error

    def _throttled(self) -> ValidationError:
        return ValidationError(throttle.words(self.wait_s), code=THROTTLED)

    def _busy(self) -> ValidationError:
        self.wait_s = RETRY_AFTER_S
        return ValidationError(_("Many people sign in at this moment. Try again in a moment."), code=BUSY)


class EndsTokens(forms.Form):
    """A form for a new password. It lets a person who has tokens end them, too."""

    end_tokens = forms.BooleanField(
        label=gettext_lazy("End all tokens of my programs, too"),
        required=False,
        help_text=gettext_lazy("Choose this if somebody else may know the old password."),
    )

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        if not tokens_of(self.person).exists():
            del self.fields["end_tokens"]

    @property
    def person(self) -> User:
        """Return the person whose password it is."""
        person: User = self.user  # type: ignore[attr-defined]  # an attribute of the other base class
        return person

    def end_chosen_tokens(self) -> int:
        """End the tokens if the person chose that. Return how many were valid."""
        chosen = self.cleaned_data.get("end_tokens")
        return tokens_end(user=self.person, actor=self.person) if chosen else 0


class OwnPasswordForm(EndsTokens, PasswordChangeForm):
    """A new password. The form also asks for the current password."""

    def __init__(self, *arguments: Any, address: str, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._address = address

    def clean_old_password(self) -> str:
        """Refuse a wrong password, and every password after too many wrong ones.

        Else somebody could guess the password on a page that was left open.
        """
        password: str = self.cleaned_data["old_password"]
        if not throttle.password_fits(self.user, password, address=self._address):
            raise ValidationError(self.error_messages["password_incorrect"], code="password_incorrect")
        return password


class ForgottenPasswordForm(ResetPasswordForm):
    """The address of an account whose password was forgotten."""

    def clean_email(self) -> str:
        """Leave out people who typed this address and did not verify it, and service accounts.

        Else the owner of the address would get access to the account of another person. Service accounts have
        no password.
        """
        email: str = super().clean_email()
        found: list[User] = self.users  # type: ignore[has-type]
        self.users = [person for person in found if person.email == email.lower() and not person.project]
        return email


class NewPasswordForm(EndsTokens, ResetPasswordKeyForm):
    """The new password of a person who forgot the old one, with the same texts as the other pages.

    The person's tokens end, unless the person chooses otherwise: somebody who had the old password may have
    made tokens.
    """

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        first, second = self.fields["password1"], self.fields["password2"]
        first.label, second.label = _("Password"), _("The password again")
        first.help_text = ""
        second.help_text = _("Eight characters or more, not only digits; a few words are easiest to keep.")
        for field in (first, second):
            field.widget.attrs.pop("placeholder", None)
        if "end_tokens" in self.fields:
            self.fields["end_tokens"].initial = True

    def save(self) -> None:
        """Set the password.

        Tokens end first: if setting the password then fails, nobody has gained access.
        """
        self.end_chosen_tokens()
        super().save()


class EmailForm(AddEmailForm):
    """A new e-mail address of a person, before it is verified."""

    def clean_email(self) -> str:
        """Refuse the current address.

        Only the person who opens the link learns that another account has the address.
        """
        address: str = self.cleaned_data["email"].lower()
        if address == self.user.email:
            raise ValidationError(_("This is your present address."), code="same_email")
        return address

    def save(self, request: HttpRequest) -> EmailAddress:
        """Send a link to the new address.

        The current address stays until the link is opened, verified or not.
        """
        with transaction.atomic():
            waiting = EmailAddress.objects.filter(user=self.user, verified=False)
            waiting.exclude(email=self.user.email).delete()
            address, _new = EmailAddress.objects.get_or_create(
                user=self.user, email=self.cleaned_data["email"]
            )
        send_verification_email_to_address(request, address)
        return address
