"""Tickets: a program signs in at a door by its address, so that no token lands in a log.

A ticket lives a minute, works once, and is worth as much as the token or the sign-in that asked for it: what it opens
ends with that.
"""

from __future__ import annotations

import secrets
from datetime import datetime, timedelta
from typing import Literal

from django.db import transaction
from django.utils import timezone

from fleet.accounts.models import User
from fleet.accounts.selectors import signed_in
from fleet.accounts.tokens.models import Ticket, Token
from fleet.accounts.tokens.services import TokenInvalid, digest_of

Door = Literal["rosbridge", "foxglove"]
LIFE = timedelta(minutes=1)
MOST = 20  # valid tickets of one person


class TooManyTickets(Exception):
    """A person has `MOST` tickets that nobody has used."""


@transaction.atomic
def ticket_make(
    *, user: User, sign_in: str, token: Token | None, robot: str, door: Door
) -> tuple[str, datetime]:
    """Make a ticket for a robot (its slug). Return its text, and its end. Raises `TooManyTickets`.

    `sign_in`: the key of the session or token that asks.
    """
    now = timezone.now()
    User.objects.select_for_update(no_key=True).get(pk=user.pk)
    Ticket.objects.filter(expires_at__lte=now).delete()
    if Ticket.objects.filter(user=user).count() >= MOST:
        raise TooManyTickets
    text = secrets.token_urlsafe(24)
    Ticket.objects.create(
        digest=digest_of(text),
        user=user,
        token=token,
        session_key="" if token else sign_in,
        robot=robot,
        door=door,
        expires_at=now + LIFE,
    )
    return text, now + LIFE


def ticket_use(text: str, *, robot: str, door: str) -> Ticket:
    """Use a ticket up, and return it. Raises `TokenInvalid`."""
    found = Ticket.objects.select_related("user", "token").filter(digest=digest_of(text)).first()
    # The one who deletes it has used it
    if found is None or not Ticket.objects.filter(pk=found.pk).delete()[0]:
        raise TokenInvalid(
            "ticket_invalid",
            "There is no such ticket: it was used already, or never made. Ask for another one.",
        )
    if found.expires_at <= timezone.now():
        raise TokenInvalid(
            "ticket_expired", "The ticket has expired: it lives one minute. Ask for another one."
        )
    if (found.robot, found.door) != (robot, door):
        raise TokenInvalid("ticket_elsewhere", "The ticket is for another robot or another door.")
    if not signed_in([(found.user_id, found.sign_in)]):
        raise TokenInvalid("signed_out", "The sign-in or token that asked for this ticket has ended.")
    return found
