"""A test e-mail, whose result is known at once."""

from __future__ import annotations

from django.conf import settings
from django.core.mail import EmailMessage, get_connection
from django.utils.translation import gettext as _

from fleet.accounts import emails
from fleet.accounts.models import User
from fleet.audit.services import record

WAIT_S = 10.0


def trial(*, to: str, actor: User) -> str:
    """Send a test e-mail. Return why the mail server did not take it, in its words; empty: it took it. Recorded."""
    fault = emails.fault_of_sender(settings.DEFAULT_FROM_EMAIL) or _send(to)
    outcome = "failed" if fault else "sent"
    record("account.email_test", actor=actor, outcome=outcome, private={"address": to, "words": fault})
    return fault


def _send(to: str) -> str:
    text = _("This is a test of the fleet console. Its e-mails arrive.")
    connection = get_connection(timeout=WAIT_S)
    try:
        EmailMessage(_("Test of the fleet console"), text, to=[to], connection=connection).send()
    except (OSError, ValueError) as error:  # OSError: also SMTPException
        return str(error) or repr(error)
    emails.server_works()
    return ""
