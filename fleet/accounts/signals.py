"""Record sign-ins, sign-outs, failed sign-ins, deleted accounts, and changes of the ways to sign in."""

from __future__ import annotations

from typing import Any

from allauth.account.authentication import get_authentication_records
from allauth.core import context
from allauth.mfa.models import Authenticator
from allauth.mfa.signals import authentication_failed
from allauth.socialaccount.models import SocialAccount
from django.contrib.auth.signals import user_logged_in, user_logged_out, user_login_failed
from django.db.models.signals import post_delete, post_save, pre_delete
from django.dispatch import receiver
from django.http import HttpRequest

from fleet.accounts import services
from fleet.accounts.changes import password_set_by_another
from fleet.accounts.models import User
from fleet.accounts.sign_in import throttle
from fleet.audit.command_line import SystemAccount, here
from fleet.audit.services import record


@receiver(user_logged_in)
def _signed_in(*, request: HttpRequest, user: User, **_: Any) -> None:
    sign_in = services.sign_in_begun(request, user)
    used = [
        method["type"] if method["method"] == "mfa" else method["method"]
        for method in get_authentication_records(request, user)
    ]
    record(
        "account.sign_in",
        actor=user,
        parameters={"by": used} if used else {},
        private={"address": sign_in.address, "browser": sign_in.user_agent},
    )


@receiver(user_logged_out)
def _signed_out(*, request: HttpRequest, user: User | None, **_: Any) -> None:
    if user is not None:
        record("account.sign_out", actor=user, private={"address": services.address_of(request)})


@receiver(user_login_failed)
def _sign_in_failed(*, credentials: dict[str, Any], request: HttpRequest | None, **_: Any) -> None:
    throttle.failure_recorded(
        username=str(credentials.get("username", "")), address=services.address_of(request) if request else ""
    )


@receiver(authentication_failed)
def _wrong_code(*, user: User, **_: Any) -> None:
    name = throttle.second_factor_of(user)
    throttle.failure_recorded(username=name, address=name, person=user)


# `created`: True for a new row, False for a changed one, missing for a deleted one. A change is recorded in its
# transaction: a change that cannot be recorded is not made.


@receiver([post_save, post_delete], sender=Authenticator)
def _second_factor_changed(*, instance: Authenticator, created: bool | None = None, **_: Any) -> None:
    if created is not False:
        outcome = "added" if created else "removed"
        parameters = {"user": str(instance.user_id), "factor": str(instance.type)}
        record("account.second_factor", actor=_actor(instance.user), outcome=outcome, parameters=parameters)


@receiver([post_save, post_delete], sender=SocialAccount)
def _single_sign_on_changed(*, instance: SocialAccount, created: bool | None = None, **_: Any) -> None:
    if created is not False:
        outcome = "joined" if created else "parted"
        parameters = {"user": str(instance.user_id)}
        record("account.single_sign_on", actor=_actor(instance.user), outcome=outcome, parameters=parameters)


def _actor(owner: User) -> User | SystemAccount:
    """Return the signed-in person, else the owner, who is just signing in.

    At the command line, return the computer account.
    """
    if context.request is None:
        return here()
    return context.request.user if isinstance(context.request.user, User) else owner


@receiver(password_set_by_another)
def _password_set_by_another(*, user: User, actor: User | SystemAccount, **_: Any) -> None:
    """End sign-ins and tokens, as after a forgotten password: the other person may not know of the tokens."""
    services.password_reset(user=user, actor=actor, why="password set by another person", tokens=True)


@receiver(pre_delete, sender=User)  # within the transaction of the deletion
def _account_deleted(*, instance: User, **_: Any) -> None:
    instance.record_deletion()
