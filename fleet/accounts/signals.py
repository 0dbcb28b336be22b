"""Records Django's signals of sign-ins, sign-outs, failures and deleted accounts."""

from __future__ import annotations

from typing import Any

from django.contrib.auth.signals import user_logged_in, user_logged_out, user_login_failed
from django.db.models.signals import pre_delete
from django.dispatch import receiver
from django.http import HttpRequest

from fleet.accounts import services, throttle
from fleet.accounts.models import User
from fleet.audit.services import record


@receiver(user_logged_in)
def _signed_in(*, request: HttpRequest, user: User, **_: Any) -> None:
    sign_in = services.sign_in_begun(request, user)
    record(
        "account.sign_in",
        actor=user,
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


@receiver(pre_delete, sender=User)  # within the transaction of the deletion
def _account_deleted(*, instance: User, **_: Any) -> None:
    instance.record_deletion()
