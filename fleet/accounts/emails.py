"""Send e-mails in a background thread: a slow mail server delays no request."""

from __future__ import annotations

import logging
import re
import threading
from collections.abc import Sequence
from contextlib import suppress
from datetime import datetime
from functools import partial
from smtplib import SMTPNotSupportedError, SMTPRecipientsRefused, SMTPSenderRefused

from django.core.mail import EmailMessage, get_connection
from django.core.mail.backends.base import BaseEmailBackend
from django.core.mail.message import sanitize_address
from django.db import DatabaseError, connections, transaction
from django.utils import timezone

from fleet.accounts.models import User
from fleet.audit.errors import AuditUnavailable
from fleet.audit.services import record

log = logging.getLogger(__name__)

SERVER_TIMEOUT_S = 20.0
# Pauses after the first try, the second, and so on: a day in all, for a quota of a day is free again then.
AGAIN_S = (60.0, 300.0, 1800.0, *(7200.0,) * 12)
# Status codes (RFC 3463) that refuse the sender, a quota or a policy. Many servers check the sender only after RCPT.
NOT_THE_ADDRESS = re.compile(r"\b5\.(1\.[78]|4\.5|7\.\d+)\b")

_works = threading.Condition()  # notified when the mail server takes e-mails again
_why_not = ""  # why it took none at the last try of this process


def why_none_leaves() -> str:
    """Return why the mail server took no e-mail of this process at the last try; empty: it took one."""
    return _why_not


def server_works() -> None:
    """Try at once what waits: the mail server has just taken an e-mail."""
    global _why_not
    with _works:
        if _why_not:
            _why_not = ""
            _works.notify_all()


def send_later(messages: Sequence[EmailMessage]) -> None:
    """Send the messages once the transaction is committed. If the server does not take them, try again for a day.

    A message whose address the server refuses is not tried again, and ends no other.
    """
    if messages:
        transaction.on_commit(partial(send_at_once, messages))


def send_at_once(messages: Sequence[EmailMessage]) -> None:
    """Send the messages as `send_later` does, without a database that tells of a commit."""
    threading.Thread(target=_send, args=[list(messages)], name="email", daemon=True).start()


def _send(waiting: list[EmailMessage]) -> None:
    try:
        _send_all(waiting)
    finally:
        connections.close_all()  # of this thread


def _send_all(waiting: list[EmailMessage]) -> None:
    global _why_not
    for pause_s in (*AGAIN_S, None):
        before = len(waiting)
        cause = _try_to_send(waiting)
        if len(waiting) < before:
            server_works()
        if not waiting:
            return
        again = "are lost" if pause_s is None else f"are tried again in {pause_s / 60:.0f} min"
        log.warning("E-mails were not sent and %s (%d): %s", again, len(waiting), cause)
        with _works:
            if len(waiting) == before:
                _why_not = cause
            _works.wait(pause_s or 0.0)


def _try_to_send(waiting: list[EmailMessage]) -> str:
    """Send each message alone, so that a fault of one ends no other. Return why the last one waits.

    Sent and refused messages leave the list; the others wait for the next try.
    """
    connection, cause = get_connection(timeout=SERVER_TIMEOUT_S), ""
    for message in list(waiting):
        try:
            delay = put_off(message, connection)
        except OSError as error:  # also SMTPException
            return str(error)
        if delay:
            cause = delay
        else:
            waiting.remove(message)
    with suppress(OSError):
        connection.close()
    return cause


def put_off(message: EmailMessage, connection: BaseEmailBackend) -> str:
    """Send a message. Return why it must wait; empty: the mail server took it, or refuses its address for good.

    A refusal is logged, recorded, and noted at the person (`User.email_refused_at`). After a failure, `connection` is
    closed.

    Raises:
        OSError: the server takes no message now: it is out of reach, or it refuses the sender, or there is no sender.

    """
    if fault := fault_of_sender(message.from_email):
        raise OSError(fault)
    connection.open()
    message.connection = connection
    refused_at: datetime | None = None
    try:
        message.send()
    except (OSError, ValueError) as error:
        with suppress(OSError):
            connection.close()  # the server may have ended it
        if isinstance(error, SMTPSenderRefused):
            raise
        if not is_of_address(error, message.to):
            return str(error) or repr(error)
        _refused(message, error)
        refused_at = timezone.now()
    _note(message.to, refused_at)
    return ""


def _note(addresses: Sequence[str], refused_at: datetime | None) -> None:
    """Note at these people when their e-mail was refused; None: the mail server took it."""
    try:
        people = User.objects.filter(email__in=[address.lower() for address in addresses])
        people.exclude(email_refused_at=refused_at).update(email_refused_at=refused_at)
    except DatabaseError as error:
        log.error("It is not noted whether an e-mail was refused: %s", error)


def fault_of_sender(sender: str) -> str:
    """Return why nobody can send e-mails as `sender`, the value of `FLEET_EMAIL_FROM`; empty: it is a sender."""
    fault = _why_not_written(sender)
    return fault and (
        f"FLEET_EMAIL_FROM is {sender!r}, which is no sender ({fault}). A name with a comma or colon needs quotation "
        'marks: "Robots, Lab" <robots@lab.example>.'
    )


def _why_not_written(address: str) -> str:
    """Return why a message cannot have this address; empty: it can."""
    try:
        sanitize_address(address, "utf-8")
    except (ValueError, TypeError) as error:  # TypeError: `Robots <>`
        return str(error)
    return ""


def is_of_address(error: Exception, addresses: Sequence[str]) -> bool:
    """Return whether an error says that one of these addresses is wrong; else the message may be sent later."""
    match error:
        case SMTPRecipientsRefused():
            is_for_good = all(code >= 500 for code, _text in error.recipients.values())
            return is_for_good and not NOT_THE_ADDRESS.search(str(error))
        case UnicodeError() | SMTPNotSupportedError():  # the server takes no address with such letters
            return True
        case ValueError():
            return any(map(_why_not_written, addresses))
    return False


def _refused(message: EmailMessage, error: Exception) -> None:
    """Log and record a message whose address the mail server refuses, so that staff find whom it did not reach."""
    log.warning("The mail server refused an e-mail: %s", error)
    private = {"address": ", ".join(message.to), "name": message.subject, "words": str(error)}
    try:
        record("account.email_refused", private=private)
    except AuditUnavailable as unavailable:
        log.error("The refused e-mail is not on record: %s", unavailable)
