"""Send e-mails in a background thread: a slow mail server delays no request."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Sequence
from functools import partial
from smtplib import SMTPDataError, SMTPRecipientsRefused

from django.core.mail import EmailMessage, get_connection
from django.db import transaction

log = logging.getLogger(__name__)

SERVER_TIMEOUT_S = 20.0
AGAIN_S = (60.0, 300.0, 1800.0, 7200.0)  # pauses after the first try, the second, and so on


def send_later(messages: Sequence[EmailMessage]) -> None:
    """Send the messages once the transaction is committed. If the server does not answer, try again for some hours.

    A message that the server refuses is logged and lost; the others are sent.
    """
    if messages:
        transaction.on_commit(partial(_in_background, messages))


def _in_background(messages: Sequence[EmailMessage]) -> None:
    threading.Thread(target=_send, args=[list(messages)], name="email", daemon=True).start()


def _send(waiting: list[EmailMessage]) -> None:
    for pause_s in (*AGAIN_S, None):
        try:
            _try_to_send(waiting)
            cause = "the server asks to try again later"
        except OSError as error:  # also SMTPException
            cause = str(error)
        if not waiting:
            return
        again = "are lost" if pause_s is None else f"are tried again in {pause_s / 60:.0f} min"
        log.warning("E-mails were not sent and %s (%d): %s", again, len(waiting), cause)
        time.sleep(pause_s or 0.0)


def _try_to_send(waiting: list[EmailMessage]) -> None:
    """Send the messages. Remove sent and refused messages from the list; the others wait for the next try."""
    with get_connection(timeout=SERVER_TIMEOUT_S) as connection:
        for message in list(waiting):
            message.connection = connection
            try:
                message.send()
            except (SMTPRecipientsRefused, SMTPDataError) as error:
                if _is_busy(error):
                    continue
                log.warning("The mail server refused an e-mail: %s", error)
            waiting.remove(message)


def _is_busy(error: SMTPRecipientsRefused | SMTPDataError) -> bool:
    """Return whether the server asks to try again later (codes 4xx)."""
    if isinstance(error, SMTPDataError):
        return error.smtp_code < 500
    return any(code < 500 for code, _text in error.recipients.values())
