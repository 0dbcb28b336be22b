"""Ends control when its holder signs out."""

from __future__ import annotations

import logging
from typing import Any

from django.contrib.auth.signals import user_logged_out
from django.dispatch import receiver
from django.http import HttpRequest
from django.utils import timezone

from fleet.accounts.models import User
from teleop.control import services
from teleop.control.changes import ControlRefused
from teleop.control.lease_checks import fingerprint
from teleop.control.selectors import SIGNED_OUT

log = logging.getLogger(__name__)


@receiver(user_logged_out)
def _signed_out(*, request: HttpRequest, user: User | None, **_: Any) -> None:
    key = request.session.session_key
    if user is None or key is None:
        return
    try:
        services.leases_end_of_sign_in(
            fingerprint(key), user_id=user.pk, refusal=SIGNED_OUT, now=timezone.now()
        )
    except ControlRefused as refused:
        log.warning("Control of %s did not end at sign-out; it ends by itself later: %s", user.pk, refused)
