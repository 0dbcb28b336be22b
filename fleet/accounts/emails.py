"""E-mails that leave at once, outside of the request: a slow mail server delays nobody."""

from __future__ import annotations

import logging
import threading
from collections.abc import Sequence
from functools import partial

from django.core.mail import EmailMessage, get_connection
from django.db import transaction

log = logging.getLogger(__name__)

SERVER_TIMEOUT_S = 20.0


def send_later(messages: Sequence[EmailMessage]) -> None:
    """Send the messages once the transaction is committed. One that the server refuses is logged and lost."""
    if messages:
        transaction.on_commit(partial(_in_background, messages))


def _in_background(messages: Sequence[EmailMessage]) -> None:
    threading.Thread(target=_send, args=[messages], name="email", daemon=True).start()


def _send(messages: Sequence[EmailMessage]) -> None:
    try:
        with get_connection(timeout=SERVER_TIMEOUT_S) as connection:
            for message in messages:
                message.connection = connection
                message.send()
    except OSError as error:  # also SMTPException
        log.warning("E-mails were not sent: %s", error)
