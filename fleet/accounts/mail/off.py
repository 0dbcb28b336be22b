"""A console without mail server: no e-mail is sent or written anywhere, because its text may have a secret."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import Any

from django.conf import settings
from django.core.mail import EmailMessage
from django.core.mail.backends.base import BaseEmailBackend
from django.http import HttpRequest

log = logging.getLogger(__name__)


class EmailBackend(BaseEmailBackend):
    """Logs that an e-mail was not sent, and to whom."""

    def send_messages(self, email_messages: Sequence[EmailMessage]) -> int:
        for message in email_messages:
            log.info("No e-mail to %s: there is no mail server (FLEET_EMAIL_URL).", ", ".join(message.to))
        return len(email_messages)


BACKEND = f"{__name__}.{EmailBackend.__name__}"


def is_off() -> bool:
    """Return whether the console has no mail server."""
    return settings.EMAIL_BACKEND == BACKEND


def mail(_request: HttpRequest) -> dict[str, Any]:
    """Return `mail_off` for templates."""
    return {"mail_off": is_off()}
